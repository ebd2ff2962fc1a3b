"""The gate: what has any one thing wrong is never sent, and what has nothing wrong always is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from judged_motions import BROKEN, MISSION, PERIOD, WELL, at, begun, moved, only

from mpc_cover.control.safety_filter import SafetyFilter
from mpc_cover.model.braking import braking_trajectory

FILTER = SafetyFilter(MISSION)
seeds = st.integers(0, 2**32 - 1)


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
