"""Two who are too near already do not excuse anybody else."""

from __future__ import annotations

import numpy as np
import pytest
from flights import fleet_of

from mpc_cover.constraints.boundary import BoundaryConditions
from mpc_cover.control.constraint_relaxation import attainable_bounds
from mpc_cover.model.braking import braking_trajectory
from mpc_cover.planning.ocp import OCP, Margins, requirements
from mpc_cover.verification.path import Path

NEAR, ASKED = 0.3, 0.8


def bounds_from(fleet):
    """Return what can be asked from a fleet's start at rest."""
    start = fleet.start, np.zeros_like(fleet.start)
    plan = braking_trajectory(*start, fleet, 0.0, 0.5, 4)
    path = Path(plan.time, plan.position, plan.velocity, plan.input)
    return attainable_bounds(fleet, [path], start)


@pytest.mark.parametrize("lost", [(), (1,)])
def test_the_planner_asks_the_other_pairs_for_all_that_the_verifier_does(lost):
    start = np.array([[1.0, 1.0], [1.0 + NEAR, 1.0], [4.0, 1.0]])
    bounds = bounds_from(fleet_of(start, separation_min=ASKED, lost=lost))
    cell, weight = np.array([[2.0, 2.0]]), np.ones((1, 1))
    ocp = OCP(bounds.planned, cell, weight, 8, 0.5, BoundaryConditions(start, np.zeros_like(start)))
    required = requirements(ocp, Margins()).separation
    assert required == pytest.approx([NEAR, ASKED + Margins().separation, ASKED + Margins().separation])


def test_nothing_is_asked_of_two_who_are_lost():
    start = np.array([[1.0, 1.0], [1.0 + NEAR, 1.0], [4.0, 1.0]])
    fleet = bounds_from(fleet_of(start, separation_min=ASKED, lost=(0, 1))).planned
    assert fleet.separations == pytest.approx([0.0, ASKED, ASKED])
