"""Separation: what the rows allow is safe between samples too."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from motions import PERIOD, random_motion

from mpc_cover.constraints.collision import collision_rows
from mpc_cover.constraints.pairs import pair_distances
from mpc_cover.constraints.rows import Layout


@given(seed=st.integers(0, 10**6), dimension=st.sampled_from([2, 3]))
def test_ends_that_satisfy_the_collision_rows_are_separated_at_every_instant_between(seed, dimension):
    """Any two ends on the right side, any relative input up to the bound: the whole interval is apart."""
    rng = np.random.default_rng(seed)
    bar = random_motion(rng, 1, 2, dimension)
    pairs, layout = pair_distances(*bar, PERIOD), Layout(1, 2, dimension)
    if pairs.least.min() < 0.7:
        return
    relative = 3.0 * rng.normal(size=dimension) / np.sqrt(dimension)
    between = np.array([np.linalg.norm(relative) * PERIOD**2 / 8])
    rows = collision_rows(layout, pairs, np.array([0.5]), between, reach=100.0)
    normal, wanted = -rows.value[:dimension], min(0.5 + between[0], -rows.upper[0])
    ends = rng.normal(scale=3.0, size=(2, dimension))
    ends += np.maximum(wanted - ends @ normal, 0.0)[:, None] * normal
    t = np.linspace(0.0, 1.0, 400)[:, None]
    path = (1 - t) * ends[0] + t * ends[1] - 0.5 * PERIOD**2 * t * (1 - t) * relative
    if wanted == pytest.approx(0.5 + between[0]):
        assert np.linalg.norm(path, axis=1).min() >= 0.5 - 1e-9


def test_an_iterate_that_is_too_near_is_asked_for_what_is_required_and_no_more():
    still = np.repeat(np.array([[[0.0, 0.0], [0.3, 0.0]]]), 2, axis=0)
    pairs = pair_distances(still, np.zeros_like(still), PERIOD)
    rows = collision_rows(Layout(1, 2, 2), pairs, np.array([0.5]), np.array([0.1]), reach=1.0)
    assert rows.upper.tolist() == [-0.5]
    assert rows.slacks == 1


def test_pairs_that_cannot_meet_within_the_trust_region_have_no_row():
    still = np.repeat(np.array([[[0.0, 0.0], [9.0, 0.0]]]), 2, axis=0)
    pairs = pair_distances(still, np.zeros_like(still), PERIOD)
    assert collision_rows(Layout(1, 2, 2), pairs, np.array([0.5]), np.array([0.1]), reach=1.0).count == 0
