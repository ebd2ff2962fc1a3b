"""Shortening a plan stretch by stretch."""

from __future__ import annotations

import numpy as np
import pytest

from mpc_cover.planning.segment_refinement import resampled


def test_resampling_plays_the_same_path_faster():
    velocity = np.zeros((11, 1, 2))
    velocity[1:-1, 0, 0] = 1.0
    faster = resampled(velocity, 8)
    assert faster.shape == (9, 1, 2)
    assert faster[:, 0, 0].sum() == pytest.approx(velocity[:, 0, 0].sum(), rel=0.05)
    assert faster[-1].tolist() == [[0.0, 0.0]]
