"""What those who are left can measure."""

from __future__ import annotations

import numpy as np
from flights import fleet_of

from mpc_cover.control.reachability import reachable


def test_what_is_measurable():
    radius = np.array([[1.0, -np.inf], [-np.inf, 2.0]])
    cell = np.array([[5.0, 5.0], [1.0, 1.0]])
    fleet = fleet_of(np.array([[0.0, 0.0], [9.0, 9.0]]), radius=radius, separation_min=0.5)
    assert reachable(fleet, cell, np.empty((0, 2))).all()
    one = fleet_of(fleet.start, radius=np.where([[True], [False]], radius, -np.inf), separation_min=0.5, lost=(1,))
    np.testing.assert_array_equal(reachable(one, cell, fleet.start[1:]), [[True, True], [False, False]])


def test_what_the_lost_stand_on_cannot_be_measured_from_too_far_away():
    cell = np.array([[5.0, 5.0], [7.0, 5.0]])
    blocked = fleet_of(np.zeros((2, 2)), separation_min=1.5, lost=(1,))
    np.testing.assert_array_equal(reachable(blocked, cell, cell[:1]), [[False, True]])
    assert reachable(fleet_of(np.zeros((2, 2)), separation_min=0.9, lost=(1,)), cell, cell[:1]).all()
