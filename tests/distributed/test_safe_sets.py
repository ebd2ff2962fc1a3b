"""Sets that hold two agents however they brake."""

from __future__ import annotations

import numpy as np
import pytest

from mpc_cover.distributed.safe_sets import enclosing_diameters


def test_the_smallest_ball_around_two():
    centre = np.array([[0.0, 0.0], [2.0, 0.0], [0.1, 0.0]])
    diameter = enclosing_diameters(centre, np.array([0.5, 0.25, 3.0]))
    assert diameter[0, 1] == pytest.approx(2.75)
    assert diameter[0, 2] == pytest.approx(6.0), "one lies in the other"
    assert (diameter == diameter.T).all()
    still = enclosing_diameters(centre, np.zeros(3))
    assert still[0, 1] == 2.0
