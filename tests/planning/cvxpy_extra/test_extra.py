"""What a user's function returns: what is taken, and each way to be wrong, by name."""

import cvxpy as cp
import numpy as np
import pytest
from tiny_mission import TINY

import mpc_cover
from mpc_cover.model.trajectory import Trajectory
from mpc_cover.planning.cvxpy_extra.extra import Extra
from mpc_cover.planning.cvxpy_extra.motion_variables import MotionVariables

MISSION = mpc_cover.load_mission(TINY)
MOTION = MotionVariables.fixed(Trajectory.at_rest(MISSION.fleet.start, 0.0, 0.5, 4), MISSION.fleet.ids)


def parts_of(function):
    return Extra("mine:wish", function).parts(MOTION, MISSION)


def returning(terms, constraints):
    """Return a function that returns what these make of the motion."""
    return lambda motion, _: (terms(motion), constraints(motion))


def nothing(_):
    return []


def wrong(terms, constraints=nothing):
    with pytest.raises(mpc_cover.UserError) as raised:
        parts_of(returning(terms, constraints))
    message = str(raised.value)
    assert message.startswith("extra mine:wish: ")
    assert "\n" not in message
    return message


def test_lists_mappings_single_ones_numbers_and_none_are_taken():
    parts = parts_of(returning(lambda m: cp.sum_squares(m.input), lambda m: m.position[:, :, 0] <= 3.0))
    assert [group.name for group in parts.groups] == ["constraints[0]"]
    parts = parts_of(returning(lambda _: [2.0], lambda m: {"wall": [q[:, 0] <= 3.0 for q in m.position]}))
    assert (float(parts.total.value), len(parts.constraints)) == (2.0, 5)
    assert [group.name for group in parts.groups] == ["wall"]
    parts = parts_of(lambda _motion, _mission: (None, None))
    assert (parts.terms, parts.groups, float(parts.total.value)) == ((), (), 0.0)


@pytest.mark.parametrize(
    ("term", "words"),
    [
        (lambda m: -cp.sum_squares(m.input), "is concave, not convex"),
        (lambda m: cp.sqrt(cp.sum_squares(m.input)), "is not convex by CVXPY's DCP rules"),
        (lambda m: m.position[:, 0], "has shape (5, 2): must be a scalar"),
        (lambda _: np.nan, "holds a number that is not finite"),
        (lambda m: cp.sum(np.inf * m.position), "holds a number that is not finite"),
        (lambda _: "speed", "is str: must be a convex CVXPY expression or a number"),
        (lambda _: True, "is bool: must be"),
        (lambda _: cp.Parameter(name="limit"), "has a parameter without a value, limit"),
        (lambda _: cp.Variable(integer=True, name="whole"), "not real and continuous, whole"),
    ],
)
def test_a_term_that_is_none_is_named(term, words):
    message = wrong(lambda m: [cp.sum_squares(m.velocity), term(m)])
    assert "terms[1]: " in message
    assert words in message


@pytest.mark.parametrize(
    ("constraint", "words"),
    [
        (lambda m: cp.norm(m.position[2, 0]) >= 1.0, "DCP rules: linearise it around motion.iterate"),
        (lambda m: m.time[0] <= 2.0, "True: compares numbers"),
        (lambda m: m.position[0, 0, 0], "is index: must be a CVXPY constraint"),
        (lambda m: m.position <= np.inf, "holds a number that is not finite"),
    ],
)
def test_a_constraint_that_is_none_is_named(constraint, words):
    message = wrong(nothing, lambda m: [m.position <= 3.0, constraint(m)])
    assert "constraints[1]: " in message
    assert words in message
    assert "wall[1]: " in wrong(nothing, lambda m: {"wall": [m.position <= 3.0, constraint(m)]})


@pytest.mark.parametrize(
    ("function", "words"),
    [
        (lambda motion, mission: None, "must return (terms, constraints), two lists or mappings, not None"),
        (lambda motion, mission: [motion.position <= 1.0], "not list of 1"),
        (lambda motion, mission: ([], 3.0), "its constraints are float"),
        (lambda motion, mission: ("speed", []), "its terms are str"),
        (lambda motion: ([], []), "must take two arguments, (motion, mission)"),
    ],
)
def test_a_function_of_another_kind(function, words):
    with pytest.raises(mpc_cover.UserError, match="mine:wish") as raised:
        parts_of(function)
    assert words in str(raised.value)


def test_an_exception_is_told_with_the_line_of_the_users_code():
    def shapes(motion, mission):
        return [], [motion.position <= np.zeros((3, 3))]

    line = shapes.__code__.co_firstlineno + 1
    with pytest.raises(mpc_cover.UserError) as raised:
        parts_of(shapes)
    assert str(raised.value).startswith("extra mine:wish: ValueError: ")
    assert str(raised.value).endswith(f"(test_extra.py, line {line})")


def test_one_that_exits_ends_nothing():
    def leave(motion, mission):
        raise SystemExit(3)

    with pytest.raises(mpc_cover.UserError, match="SystemExit"):
        parts_of(leave)
