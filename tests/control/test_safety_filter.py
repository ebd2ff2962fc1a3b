"""The gate: what has any one thing wrong is never sent, and what has nothing wrong always is."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from flights import leg, propagate
from hypothesis import given, settings
from hypothesis import strategies as st

from mpc_cover.control.safety_filter import SafetyFilter
from mpc_cover.mission.load import load_mission
from mpc_cover.model.braking import braking_trajectory
from mpc_cover.model.fleet_state import FleetState
from mpc_cover.model.trajectory import Trajectory
from mpc_cover.planning.budget import Budget
from mpc_cover.planning.offline import offline_task
from mpc_cover.planning.planner import Planner

MISSION = load_mission("box-3")
START, PERIOD = MISSION.fleet.start, MISSION.spec.control.period_s
FILTER = SafetyFilter(MISSION)
EAST = np.array([1.0, 0.0])
seeds = st.integers(0, 2**32 - 1)


def at(position, velocity=None, time=0.0, **changes):
    position = np.asarray(position, dtype=float)
    velocity = np.zeros_like(position) if velocity is None else np.asarray(velocity, dtype=float)
    return replace(FleetState.nominal(position, velocity, time), **changes)


@lru_cache
def plan():
    """Return a plan of the whole mission."""
    found = Planner("piqp").quick(offline_task(MISSION), Budget.counted(1.0))
    assert found.complete
    return found.plan


def begun(rng):
    """Return what is left of the plan after some samples, and the state there."""
    done = int(rng.integers(plan().steps - 2))
    return plan().slice(done, plan().steps), at(plan().position[done], plan().velocity[done], plan().time[done])


def together(speeds):
    """Return the motion of everyone side by side to the east, at these speeds [m/s] at samples 1 to N."""
    velocity = np.asarray(speeds)[:, None, None] * np.repeat(EAST[None], 3, axis=0)
    return at(START).trajectory(velocity, PERIOD), at(START)


def moved(displacement, state=None):
    """Return the motion by (3, 2) [m] from rest to rest, and the state that it starts in."""
    state = state or at(START)
    force = leg(displacement, PERIOD, 3, 8)
    time = state.time + PERIOD * np.arange(len(force) + 1)
    return Trajectory(time, *propagate(state.position, force, time), force, PERIOD), state


def only(agent, displacement):
    return np.where(np.arange(3)[:, None] == agent, np.asarray(displacement, dtype=float), 0.0)


def passing(aside):
    """Return a motion on which two pass each other between two samples, `aside` [m] of each other."""
    position = np.array([[2.875, 2.0], [5.125, 2.0 + aside], [4.0, 4.5]])
    velocity = np.array([[1.5, 0.0], [-1.5, 0.0], [0.0, 0.0]])
    state = at(position, velocity)
    return state.trajectory(np.array([1.0, 1.0, 0.5, 0.0])[:, None, None] * velocity, PERIOD), state


def along_the_wall(outwards):
    """Return a motion that turns back before the wall, near it at two samples, at this speed outwards [m/s]."""
    velocity = only(0, [-outwards, 0.0])
    state = at([[MISSION.fleet.motion_min[0] + 0.01 + PERIOD * outwards, 2.0], *START[1:]], velocity)
    return state.trajectory(np.array([1.0, -1.0, 0.0])[:, None, None] * velocity, PERIOD), state


def past_the_lost(aside, *, moving=False):
    """Return a motion of a1 past a2, which is lost, and of which the plan says that it is far away.

    It rests, or still brakes, `aside` [m] of the way when a1 is there; then it comes to rest `ON` farther.
    """
    end = np.array([3.125, 2.0 + aside + (ON if moving else 0.0)])
    course = Trajectory(
        np.array([0.0, 2.0]), np.array([end - [0.0, 3.0], end]), np.array([[0.0, 3.0], [0, 0]]), np.array([[0.0, -1.5]])
    )
    assert not moving or course.at(1.25)[0] == pytest.approx([3.125, 2.0 + aside])
    others = START[0], [2.0, 4.5]
    state = at(
        [others[0], end, others[1]], lost=np.array([False, True, False]), obstacles={1: course} if moving else {}
    )
    velocity = np.array([0.75, 1.5, 1.5, 0.75, 0.0])[:, None, None] * only(0, EAST)
    return at([others[0], [9.0, 9.0], others[1]]).trajectory(velocity, PERIOD), state


ON = 0.421875
"""How far the lost still brakes when a1 has passed [m]."""


# what has one thing wrong


def excess(rng):
    """Return by how much too much, a little or a lot."""
    return float(10.0 ** rng.uniform(-4.0, -0.7))


def with_number(rng):
    """Return a trajectory with one number that is none, or of no motion."""
    trajectory, state = begun(rng)
    name = str(rng.choice(["time", "position", "velocity", "input"]))
    array = getattr(trajectory, name).copy()
    array.flat[rng.integers(array.size)] = rng.choice([np.nan, np.inf, -np.inf, 1e12, 1e300])
    return replace(trajectory, **{name: array}), state


def with_shape(rng):
    trajectory, state = begun(rng)
    name = str(rng.choice(["time", "position", "velocity", "input"]))
    array = getattr(trajectory, name)
    change = rng.choice(["shorter", "longer", "fewer", "flat", "none"])
    wrong = {
        "shorter": array[:-1],
        "longer": np.concatenate([array, array[-1:]]),
        "fewer": array[:, :2] if array.ndim == 3 else array[::2],
        "flat": array.reshape(len(array), -1) if array.ndim == 3 else array[:, None],
        "none": array[:0],
    }
    return replace(trajectory, **{name: wrong[str(change)]}), state


def with_start(rng):
    trajectory, state = begun(rng)
    name = str(rng.choice(["position", "velocity"]))
    array = getattr(state, name).copy()
    array.flat[rng.integers(array.size)] += rng.choice([-1.0, 1.0]) * 10.0 ** rng.uniform(-5.0, 1.0)
    return trajectory, replace(state, **{name: array})


def with_grid(rng):
    trajectory, state = begun(rng)
    time = trajectory.time.copy()
    change = rng.choice(["later", "slower", "one", "backwards"])
    if change == "later":
        time += rng.choice([-1.0, 1.0]) * 10.0 ** rng.uniform(-5.0, 2.0)
    elif change == "slower":
        time = time[0] + (time - time[0]) * (1.0 + rng.choice([-1.0, 1.0]) * 10.0 ** rng.uniform(-5.0, -0.5))
    elif change == "one":
        time[rng.integers(time.size)] += 10.0 ** rng.uniform(-5.0, -1.0)
    else:
        time = time[::-1]
    return replace(trajectory, time=time), state


def with_period(rng):
    trajectory, state = begun(rng)
    return replace(trajectory, period=float(rng.choice([np.nan, np.inf, 0.0, -0.5, 0.25, 0.5 + excess(rng)]))), state


def with_jump(rng):
    """Return a trajectory of which one sample does not follow from the one before."""
    trajectory, state = begun(rng)
    name = str(rng.choice(["position", "velocity", "input"]))
    array = getattr(trajectory, name).copy()
    sample = rng.integers(1, len(array))
    array[sample, rng.integers(3), rng.integers(2)] += rng.choice([-1.0, 1.0]) * 10.0 ** rng.uniform(-4.0, 0.0)
    return replace(trajectory, **{name: array}), state


def with_end(rng):
    """Return a trajectory that ends while someone moves."""
    trajectory, state = begun(rng)
    fast = np.flatnonzero(np.abs(trajectory.velocity).max(axis=(1, 2)) > 1e-3)
    return trajectory.slice(0, int(rng.choice(fast[fast > 0]))), state


BROKEN = {
    "a number is none": with_number,
    "a shape is wrong": with_shape,
    "another start": with_start,
    "another time grid": with_grid,
    "another period": with_period,
    "a jump": with_jump,
    "it does not end at rest": with_end,
    "too fast": lambda rng: together([0.7, 1.4, 1.5 + excess(rng), 1.4, 0.7, 0.0]),
    "too much input": lambda rng: together([0.75 + excess(rng), 0.1, 0.0]),
    "two meet between samples": lambda rng: passing(rng.uniform(-0.499, 0.499)),
    "out of the box": lambda rng: moved(np.tile([MISSION.fleet.motion_min[0] - 2.0 - excess(rng), 0.0], (3, 1))),
    "out of the box between samples": lambda rng: along_the_wall(rng.uniform(0.0801, 0.36)),
    "out of range": lambda rng: moved(only(2, [0.0, np.sqrt(5.5**2 - 1.0) - 2.0 + excess(rng)])),
    "through the lost": lambda rng: past_the_lost(rng.uniform(-0.499, 0.499)),
    "through the lost on its way to rest": lambda rng: past_the_lost(rng.uniform(0.08, 0.499), moving=True),
}


WELL = {
    "the rest of a plan": begun,
    "as fast as one may": lambda rng: together([0.7, 1.4, 1.5, 1.4, 0.7, 0.0]),
    "all the input there is": lambda rng: together([0.75, 0.0]),
    "two pass": lambda rng: passing(rng.choice([-1.0, 1.0]) * rng.uniform(0.501, 1.5)),
    "up to the wall": lambda rng: moved(np.tile([MISSION.fleet.motion_min[0] - 2.0, 0.0], (3, 1))),
    "up to the wall between samples": lambda rng: along_the_wall(rng.uniform(0.01, 0.0799)),
    "up to the range": lambda rng: moved(only(2, [0.0, np.sqrt(5.5**2 - 1.0) - 2.0])),
    "past the lost": lambda rng: past_the_lost(rng.choice([-1.0, 1.0]) * rng.uniform(0.501, 1.5)),
    "past where the lost has come to rest": lambda rng: past_the_lost(ON + rng.uniform(0.08, 0.499)),
    "past the lost on its way to rest": lambda rng: past_the_lost(rng.uniform(1.0, 2.0), moving=True),
    "it rests": lambda rng: (at(START).trajectory(np.zeros((int(rng.integers(1, 9)), 3, 2)), PERIOD), at(START)),
}


@pytest.mark.parametrize("kind", BROKEN)
@settings(max_examples=40)
@given(seeds)
def test_what_has_one_thing_wrong_is_not_sent(kind, seed):
    trajectory, state = BROKEN[kind](np.random.default_rng(seed))
    verdict = FILTER.admit(trajectory, state, None)
    assert not verdict.admitted
    assert verdict.reason


@pytest.mark.parametrize("kind", WELL)
@settings(max_examples=20)
@given(seeds)
def test_what_has_nothing_wrong_is_sent(kind, seed):
    trajectory, state = WELL[kind](np.random.default_rng(seed))
    verdict = FILTER.admit(trajectory, state, None)
    assert verdict.admitted, verdict.reason
    assert not verdict.reason


# whatever it is


@settings(max_examples=60)
@given(seeds)
def test_nothing_that_is_proposed_makes_it_raise(seed):
    rng = np.random.default_rng(seed)

    def anything():
        shape = [int(rng.choice([0, 1, 2, 3, 5])) for _ in range(rng.integers(0, 4))]
        return rng.choice([0.0, 1.0, np.nan, np.inf, -1e300, 1e300, 0.5], size=shape)

    trajectory, state = begun(rng)
    names = rng.permutation(["time", "position", "velocity", "input"])[: rng.integers(1, 5)]
    verdict = FILTER.admit(replace(trajectory, **{str(name): anything() for name in names}), state, None)
    assert not verdict.admitted


def renumbered(trajectory, state, fleet, order):
    """Return the same motion, state and fleet with other numbers for the agents."""
    place = np.argsort(order)
    motion = replace(trajectory, **{name: getattr(trajectory, name)[:, order] for name in MOVED})
    arrays = {name: getattr(state, name)[order] for name in ("position", "velocity", "lost", "speed_share")}
    state = replace(state, **arrays, obstacles={int(place[i]): course for i, course in state.obstacles.items()})
    arrays = {name: getattr(fleet, name)[order] for name in ("start", "input_max", "speed_max", "radius")}
    return motion, state, replace(fleet, **arrays, ids=tuple(fleet.ids[i] for i in order))


def elsewhere(trajectory, state, fleet, offset):
    """Return the same motion, state and fleet at another place."""
    course = {i: replace(course, position=course.position + offset) for i, course in state.obstacles.items()}
    return (
        replace(trajectory, position=trajectory.position + offset),
        replace(state, position=state.position + offset, obstacles=course),
        replace(fleet, motion_min=fleet.motion_min + offset, motion_max=fleet.motion_max + offset),
    )


MOVED = ("position", "velocity", "input")
ANY = {**WELL, **{name: make for name, make in BROKEN.items() if name not in {"a shape is wrong", "a number is none"}}}


@settings(max_examples=80)
@given(seeds, st.sampled_from(sorted(ANY)), st.permutations(range(3)), st.tuples(*[st.floats(-50.0, 50.0)] * 2))
def test_neither_numbers_nor_places_change_a_verdict(seed, kind, order, offset):
    trajectory, state = ANY[kind](np.random.default_rng(seed))
    expected = FILTER.admit(trajectory, state, None).admitted
    for motion, there, fleet in (
        renumbered(trajectory, state, MISSION.fleet, list(order)),
        elsewhere(trajectory, state, MISSION.fleet, np.array(offset)),
    ):
        assert SafetyFilter(replace(MISSION, fleet=fleet)).admit(motion, there, None).admitted == expected


# states outside of their bounds


def anywhere(rng):
    """Return a state in which pairs may be too near, someone out of range, outside the box, or too fast."""
    middle, spread = rng.uniform(0.0, 10.0, 2), 10.0 ** rng.uniform(-1.5, 1.0)
    speed = rng.normal(size=(3, 2))
    speed *= rng.uniform(0.0, 1.8, (3, 1)) / np.linalg.norm(speed, axis=1, keepdims=True)
    lost = rng.random(3) < 0.2
    lost[rng.integers(3)] = False
    speed[lost] = 0.0
    position = middle + rng.uniform(-spread, spread, (3, 2))
    return at(position, speed * (rng.random() < 0.8), float(rng.integers(9)) * PERIOD, lost=lost)


def incumbent_of(rng, state):
    """Return a motion that keeps the input's limit and ends at rest, and has the fleet near this state some time."""
    before, velocity = int(rng.integers(3)), np.zeros((12, 3, 2))
    for n in range(1, 12):
        push = rng.normal(size=(3, 2)) if n < 4 else -velocity[n - 1] / PERIOD
        size = np.linalg.norm(push, axis=1, keepdims=True)
        velocity[n] = velocity[n - 1] + PERIOD * push * np.minimum(1.0, 1.5 / np.maximum(size, 1e-9))
    velocity[:, state.lost] = 0.0
    assert not velocity[-1].any()
    nominal = replace(state, velocity=velocity[0], time=state.time - before * PERIOD)
    return nominal.trajectory(velocity[1:], PERIOD), velocity[before]


@settings(max_examples=300)
@given(seeds, st.booleans())
def test_whatever_the_state_the_plan_flown_so_far_goes_on_or_the_brake_is_sent(seed, flown):
    rng = np.random.default_rng(seed)
    state, incumbent = anywhere(rng), None
    if flown:
        incumbent, velocity = incumbent_of(rng, state)
        strayed = rng.normal(scale=rng.choice([0.0, 1e-3, 0.1]), size=(3, 2))
        state = replace(state, velocity=np.where(state.lost[:, None], 0.0, velocity + strayed))
    stop = braking_trajectory(state.position, state.velocity, MISSION.fleet, state.time, PERIOD, 20)
    ways = [stop] if incumbent is None else [incumbent.remainder(state.time, state.position, state.velocity), stop]
    verdicts = [FILTER.admit(way, state, incumbent) for way in ways]
    assert any(verdict.admitted for verdict in verdicts), [verdict.reason for verdict in verdicts]


@pytest.mark.parametrize(
    ("position", "worse"),
    [
        ([[2.0, 2.0], [2.3, 2.0], [3.0, 4.0]], only(1, [-0.01, 0.0])),
        ([[1.0, 1.0], [2.0, 1.0], [2.0, 6.6]], only(2, [0.0, 0.01])),
        ([[-0.1, 1.0], [1.0, 1.0], [1.0, 3.0]], only(0, [-0.01, 0.0])),
    ],
    ids=["a pair is too near", "out of range", "outside of the box"],
)
def test_bounds_that_are_exceeded_already_may_not_be_exceeded_by_more(position, worse):
    state = at(position)
    assert FILTER.admit(moved(0.0 * worse, state)[0], state, None).admitted
    assert FILTER.admit(moved(-worse, state)[0], state, None).admitted
    assert not FILTER.admit(moved(worse, state)[0], state, None).admitted
