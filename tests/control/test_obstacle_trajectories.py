"""The lost are obstacles where they are, not only where they will rest."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from flights import fleet_of
from hypothesis import given, settings
from hypothesis import strategies as st

from mpc_cover.control.constraint_relaxation import strict_bounds
from mpc_cover.control.obstacle_trajectories import path_among
from mpc_cover.model.fleet_state import FleetState
from mpc_cover.model.trajectory import Trajectory


def braking(position, velocity, begin, force=1.5):
    """Return the course of an agent that brakes hardest from `begin` on."""
    speed = np.linalg.norm(velocity)
    duration = speed / force
    push = -force / speed * velocity
    end = position + 0.5 * duration * velocity
    pieces = [[position, end], [velocity, 0.0 * velocity], [push]]
    return Trajectory(np.array([begin, begin + duration]), *(np.array(piece) for piece in pieces))


def among(plan, index, course, *, moving=True):
    """Return the state at a plan's start in which one agent is lost, and comes to rest at the end of its course."""
    position, velocity = plan.position[0].copy(), plan.velocity[0].copy()
    position[index], velocity[index] = course.position[-1], 0.0
    state = FleetState.nominal(position, velocity, plan.start_time)
    return replace(state, lost=np.arange(len(position)) == index, obstacles={index: course} if moving else {})


def random_plan(rng, agents=3, steps=5):
    velocity = np.zeros((steps + 1, agents, 2))
    velocity[1:-1] = rng.normal(size=(steps - 1, agents, 2))
    return Trajectory.from_velocities(rng.normal(size=(agents, 2)), velocity[0], velocity[1:], 2.0, 0.5)


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(0.2, 1.5), st.floats(0.0, 0.95))
def test_the_path_is_the_plan_for_all_but_the_lost_and_the_course_for_these(seed, speed, over):
    rng = np.random.default_rng(seed)
    plan = random_plan(rng)
    angle = rng.uniform(0.0, 2.0 * np.pi)
    course = braking(rng.normal(size=2), speed * np.array([np.cos(angle), np.sin(angle)]), 2.0 - over * speed / 1.5)
    path = path_among(plan, among(plan, 1, course))
    assert set(np.round(plan.time, 9)) <= set(np.round(path.time, 9))
    for time, position, velocity in zip(path.time, path.position, path.velocity, strict=True):
        there, fast = plan.at(time)
        np.testing.assert_allclose(position[[0, 2]], there[[0, 2]], atol=1e-9)
        np.testing.assert_allclose(velocity[[0, 2]], fast[[0, 2]], atol=1e-7)
        left = max(0.0, course.time[-1] - time)
        away = course.position[-1] - 0.5 * 1.5 * left**2 * course.velocity[0] / speed
        np.testing.assert_allclose(position[1], away, atol=1e-9)
    step = np.diff(path.time)[:, None, None]
    moved = path.position[:-1] + step * path.velocity[:-1] + 0.5 * step**2 * path.force
    np.testing.assert_allclose(moved, path.position[1:], atol=1e-9)


def test_a_plan_that_passes_where_the_lost_still_is_does_not_hold():
    """Where it comes to rest it is out of the way; while it gets there it is not."""
    fleet = fleet_of(np.array([[0.0, 0.0], [0.0, 9.0]]), separation_min=0.5, lost=(1,))
    course = braking(np.array([-1.0, 0.55]), np.array([3.0, 0.0]), 0.0)
    still = np.zeros((2, 2))
    start = np.array([[0.0, 0.0], course.position[-1]])
    up = np.array([[0.0, 0.25], [0.0, 0.0]])
    for velocity, holds in ((up, True), (2.8 * up, False)):
        plan = Trajectory.from_velocities(start, still, np.stack([velocity, np.zeros((2, 2))], axis=1), 0.0, 0.5)
        at_rest, moving = among(plan, 1, course, moving=False), among(plan, 1, course)
        assert strict_bounds(fleet).keeps(path_among(plan, at_rest), at_rest.actual)
        np.testing.assert_array_equal(moving.actual, [[[0.0, 0.0], [-1.0, 0.55]], [[0.0, 0.0], [3.0, 0.0]]])
        assert strict_bounds(fleet).keeps(path_among(plan, moving), moving.actual) == holds


@settings(max_examples=30)
@given(st.integers(0, 2**32 - 1), st.booleans())
def test_what_a_plan_says_of_the_lost_does_not_matter(seed, moving):
    rng = np.random.default_rng(seed)
    plan, course = random_plan(rng), braking(rng.normal(size=2), rng.normal(size=2), 1.9)
    state, elsewhere = among(plan, 1, course, moving=moving), plan.position.copy()
    elsewhere[:, 1] += rng.normal(size=(plan.steps + 1, 2))
    one, two = path_among(plan, state), path_among(replace(plan, position=elsewhere), state)
    for name in ("time", "position", "velocity", "force"):
        np.testing.assert_array_equal(getattr(one, name), getattr(two, name))


def test_once_at_rest_the_lost_stay():
    plan = random_plan(np.random.default_rng(0))
    course = braking(np.zeros(2), np.array([1.0, 0.0]), 0.0)
    path = path_among(plan, among(plan, 1, course))
    assert path.time.size == plan.steps + 1
    np.testing.assert_array_equal(path.position[:, [0, 2]], plan.position[:, [0, 2]])
    np.testing.assert_array_equal(path.position[:, 1], np.tile(course.position[-1], (plan.steps + 1, 1)))
    assert not path.velocity[:, 1].any()
    assert not path.force[:, 1].any()
