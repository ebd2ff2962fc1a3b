"""The plant is exact, whoever cuts its motion into pieces, and stands still when its plans are over."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mpc_cover.model.motion import roll_out
from mpc_cover.model.trajectory import Trajectory
from mpc_cover.service.agent.schedule import STANDSTILL, Plant, Schedule, ScheduledPlan, predict
from mpc_cover.service.protocol.messages import PlanRef


def flight(start_s, force, *, period=0.5, position=(0.0, 0.0), velocity=(0.0, 0.0), seq=0):
    q, v = roll_out(np.array([position]), np.array([velocity]), np.array(force, dtype=float)[:, None], period)
    motion = Trajectory.even(start_s, period, q[:, 0], v[:, 0], np.array(force, dtype=float))
    return ScheduledPlan(PlanRef(1, seq), motion)


UP = flight(10.0, [[0.0, 1.0], [0.0, 0.0], [0.0, -1.0]])


def plant(time_s=9.0):
    return Plant(time_s, np.zeros(2), np.zeros(2))


def test_it_waits_flies_the_plan_exactly_and_rests():
    moving = plant()
    schedule = Schedule(1.0, queue=(UP,))
    for index in range(4):
        moving.advance(10.0 + 0.5 * index, schedule)
        np.testing.assert_allclose(moving.position, UP.motion.position[index], atol=1e-14)
        np.testing.assert_allclose(moving.velocity, UP.motion.velocity[index], atol=1e-14)
    moving.advance(1000.0, schedule)
    np.testing.assert_allclose(moving.position, UP.motion.position[-1], atol=1e-14)
    assert not moving.velocity.any()


@given(st.lists(st.floats(9.0, 14.0), max_size=20))
def test_the_pieces_in_which_it_moves_make_no_difference(instants):
    at_once, by_pieces = plant(), plant()
    at_once.advance(14.0, Schedule(1.0, queue=(UP,)))
    schedule = Schedule(1.0, queue=(UP,))
    for instant in sorted(instants):
        by_pieces.advance(instant, schedule)
    by_pieces.advance(14.0, schedule)
    np.testing.assert_allclose(by_pieces.position, at_once.position, atol=1e-7)
    assert np.abs(by_pieces.velocity).max() <= STANDSTILL


@given(st.floats(10.0, 12.0))
def test_the_planned_state_is_the_flown_one(instant):
    moving = plant()
    moving.advance(instant, Schedule(1.0, queue=(UP,)))
    q, v = UP.motion.at(instant)
    np.testing.assert_allclose(moving.position, q, atol=1e-7)
    np.testing.assert_allclose(moving.velocity, v, atol=1e-7)


@given(st.floats(9.0, 20.0))
def test_what_is_predicted_is_what_happens_and_nothing_has_changed(instant):
    moving, schedule = plant(), Schedule(1.0, queue=(UP,))
    q, v = predict(moving, schedule, instant)
    assert moving.time_s == 9.0
    assert schedule.flown is None
    assert schedule.queue == (UP,)
    moving.advance(instant, schedule)
    np.testing.assert_array_equal(moving.position, q)
    np.testing.assert_array_equal(moving.velocity, v)


def test_it_switches_exactly_at_the_start_of_the_newer_plan():
    moving, schedule = plant(), Schedule(1.0, queue=(UP,))
    moving.advance(10.3, schedule)
    q, v = UP.motion.position[1], UP.motion.velocity[1]
    newer = flight(10.5, [[0.0, -1.0], [0.0, 0.0]], position=tuple(q), velocity=tuple(v), seq=1)
    schedule.add(newer)
    assert schedule.queue == (newer,)
    moving.advance(12.0, schedule)
    np.testing.assert_allclose(moving.position, newer.motion.position[-1], atol=1e-14)
    assert schedule.flown is newer


def test_a_newer_plan_takes_the_place_of_those_that_start_later():
    first, second = flight(12.0, [[0.0, 0.0]], seq=1), flight(13.0, [[0.0, 0.0]], seq=2)
    schedule = Schedule(1.0, queue=(first, second))
    newer = flight(12.5, [[0.0, 0.0]], seq=3)
    schedule.add(newer)
    assert schedule.queue == (first, newer)


@pytest.mark.parametrize("velocity", [(0.4, -0.3), (1e-3, 0.0), (1e-7, 1e-7), (1e-12, 0.0), (0.0, 0.0)])
def test_whoever_still_moves_after_its_plan_brakes_within_its_limits(velocity):
    log = []
    moving = Plant(1e6, np.zeros(2), np.array(velocity), lambda *piece: log.append(piece))
    schedule = Schedule(2.0)
    moving.advance(1e6 + 5.0, schedule)
    assert not moving.velocity.any()
    assert max(np.linalg.norm(piece[3]) for piece in log) <= 2.0 * (1 + 1e-9)
    speed = np.hypot(*velocity)
    assert np.linalg.norm(moving.position) == pytest.approx(speed**2 / 4.0, abs=1e-9)
    assert schedule.rests(moving.time_s, moving.velocity)


def test_at_rest_means_that_nothing_is_left_to_fly():
    still = np.zeros(2)
    assert Schedule(1.0).rests(0.0, still)
    assert not Schedule(1.0).rests(0.0, np.array([0.1, 0.0]))
    assert not Schedule(1.0, queue=(UP,)).rests(9.0, still)
    assert not Schedule(1.0, flown=UP).rests(10.0, still)
    assert Schedule(1.0, flown=UP).rests(11.6, still)
    assert Schedule(1.0, flown=flight(0.0, [[0.0, 0.0]] * 4)).rests(0.5, still)
