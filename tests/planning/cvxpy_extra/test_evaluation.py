"""A user's terms and constraints on a motion: values, margins, and where they are least."""

import cvxpy as cp
import numpy as np
import pytest
from tiny_mission import TINY

import mpc_cover
from mpc_cover.model.trajectory import Trajectory
from mpc_cover.planning.cvxpy_extra.evaluation import evaluate
from mpc_cover.planning.cvxpy_extra.extra import Extra

MISSION = mpc_cover.load_mission(TINY)
STEPS, PERIOD = 6, 0.5


def ahead():
    """Return a motion whose agents fly north, a2 faster than a1."""
    velocity = np.zeros((STEPS + 1, 2, 2))
    velocity[:, 0, 1], velocity[:, 1, 1] = 0.3, 0.6
    return Trajectory.from_velocities(MISSION.fleet.start, velocity[0], velocity[1:], 0.0, PERIOD)


def judged(function, motion=None):
    return evaluate(Extra("mine:wish", function), motion or ahead(), MISSION)


def test_terms_are_worth_what_they_are_in_the_motions_own_numbers():
    found = judged(lambda motion, _: ([cp.sum(motion.position[-1, :, 1]), 2.0], []))
    assert found.value == pytest.approx(0.5 + 0.9 + 0.5 + 1.8 + 2.0)
    assert (found.terms, found.holds, found.violation) == (2, True, 0.0)


def test_a_violation_is_told_with_its_size_agent_and_time():
    (wall,) = judged(lambda motion, _: ([], {"wall": motion.position[:, :, 1] <= 2.0})).groups
    assert (wall.name, wall.holds) == ("wall", False)
    assert wall.margin == pytest.approx(-0.3)
    assert wall.where.endswith("a2, t = 3.000 s")
    (wall,) = judged(lambda motion, _: ([], {"wall": motion.position[:, :, 1] <= 2.5})).groups
    assert wall.holds
    assert wall.margin == pytest.approx(0.2)


def test_an_agents_part_of_a_row_is_named_and_so_is_the_entry_of_anything_else():
    def wish(motion, mission):
        return [], [motion.position[-1, :, 1] <= 2.0, motion.velocity[1:4, 1] <= 0.5, motion.position[0, 0, 0] <= 0.0]

    places = [group.where.rpartition(" <= ")[2] for group in judged(wish).groups]
    assert places == ["2.0, a2", "0.5, entry [0, 1]", "0.0"]


def test_a_group_is_judged_by_its_worst_and_an_equality_by_its_distance():
    def wish(motion, mission):
        return [], {"rows": [q[:, 1] <= 2.2 for q in motion.position], "meet": motion.position[-1, 0] == [0.75, 1.5]}

    rows, meet = judged(wish).groups
    assert rows.margin == pytest.approx(-0.1)
    assert (meet.holds, meet.margin) == (False, pytest.approx(-0.1))


def test_a_constraint_linearised_at_the_iterate_is_judged_as_it_is_meant():
    def keep_out(motion, mission):
        centre = np.array([2.25, 1.5])
        away = motion.iterate.position - centre
        away /= np.linalg.norm(away, axis=2, keepdims=True)
        return [], [cp.sum(cp.multiply(away, motion.position - centre), axis=2) >= 0.25]

    nearest = np.linalg.norm(ahead().position - [2.25, 1.5], axis=2).min() - 0.25
    assert judged(keep_out).groups[0].margin == pytest.approx(nearest)


def test_variables_of_the_users_own_take_the_best_values():
    def farthest(motion, mission):
        bound = cp.Variable()
        return [bound], {"bound": cp.max(motion.position[:, :, 1]) <= bound}

    found = judged(farthest)
    assert found.value == pytest.approx(2.3, abs=1e-5)
    assert found.holds


@pytest.mark.parametrize("far", [0.0, 1e6])
def test_such_variables_do_not_move_the_motion_however_far_away_it_is(far):
    def within(motion, mission):
        slack = cp.Variable(nonneg=True)
        return [0.001 * slack], {"wall": motion.position[:, :, 1] <= far + 2.0, "use": slack >= 1.0}

    motion = ahead()
    moved = Trajectory(motion.time, motion.position + far, motion.velocity, motion.input, motion.period)
    wall = judged(within, moved).groups[0]
    assert (wall.holds, wall.margin) == (False, pytest.approx(-0.3, abs=1e-6))


@pytest.mark.parametrize(
    ("function", "words"),
    [
        (lambda motion, mission: ([cp.Variable()], []), "no lower bound: CVXPY's status is unbounded"),
        (
            lambda motion, mission: ([cp.Variable(nonneg=True)], [motion.position[1] <= 0, motion.position[1] >= 1]),
            "infea",
        ),
        (lambda motion, mission: ([-cp.sum(cp.log(motion.velocity))], []), r"terms\[0\] has no finite value"),
    ],
)
def test_terms_without_a_value(function, words):
    with pytest.raises(mpc_cover.UserError, match=words):
        judged(function)
