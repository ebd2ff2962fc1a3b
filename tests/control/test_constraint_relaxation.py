"""Bounds that a state outside its bounds can keep: worked out at once, the same as pair by pair and agent by agent."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from flights import fleet_of
from hypothesis import given, settings
from hypothesis import strategies as st

from mpc_cover.control.constraint_relaxation import MotionBounds, longest_edge, relaxed, strict_bounds
from mpc_cover.model.motion import roll_out
from mpc_cover.verification.path import Path
from mpc_cover.verification.separation import smallest_separation

PERIOD, ROUNDING = 0.5, 1e-6


def random_motions(seed, agents, lost=()):
    """Return a fleet, and two motions from the same state, on which those who are lost stand still."""
    rng = np.random.default_rng(seed)
    start = rng.uniform(0.0, 1.2 * np.sqrt(agents), (agents, 2))
    speed = rng.uniform(-0.4, 0.4, start.shape)
    speed[list(lost)] = 0.0
    paths = []
    for _ in range(2):
        force = rng.uniform(-0.6, 0.6, (3, agents, 2))
        force[:, list(lost)] = 0.0
        position, velocity = roll_out(start, speed, force, PERIOD)
        paths.append(Path(PERIOD * np.arange(4.0), position, velocity, force))
    separation, reach = rng.uniform(0.0, 0.4), rng.uniform(0.8, 2.5)
    return fleet_of(start, separation_min=separation, communication_range=reach, lost=lost), *paths


def one_by_one(path, fleet):
    """Return how near [m] each pair comes of which one takes part at least, pair by pair."""
    found = {}
    for i in range(fleet.size):
        for j in range(i + 1, fleet.size):
            if i in fleet.active or j in fleet.active:
                pair = [i, j]
                two = Path(path.time, path.position[:, pair], path.velocity[:, pair], path.force[:, pair])
                found[i, j] = smallest_separation(two).value
    return found


def keeps_mixed_one_by_one(bounds, path, other):
    """Return what `keeps_mixed` does, a whole fleet for each agent that flies the other motion."""
    fleet = bounds.fleet
    for index in fleet.active:
        mixed = []
        for own, others in zip(
            (path.position, path.velocity, path.force), (other.position, other.velocity, other.force), strict=True
        ):
            one = own.copy()
            one[:, index] = others[:, index]
            mixed.append(one)
        motion = Path(path.time, *mixed)
        if longest_edge(motion, fleet) > fleet.communication_range + ROUNDING:
            return False
        if any(
            value < bounds.pair_separation.get(pair, fleet.separation_min) - ROUNDING
            for pair, value in one_by_one(motion, fleet).items()
        ):
            return False
    return True


def some_lost(agents):
    return st.sets(st.integers(0, agents - 1), max_size=agents).map(lambda lost: tuple(sorted(lost)))


@st.composite
def cases(draw):
    agents = draw(st.integers(1, 6))
    lost = draw(some_lost(agents))
    return random_motions(draw(st.integers(0, 2**32 - 1)), agents, lost)


@settings(max_examples=150)
@given(cases(), st.sampled_from(["strict", "relaxed", "unbounded range"]))
def test_mixed_motions_are_judged_as_agent_by_agent(case, kind):
    fleet, path, other = case
    bounds = strict_bounds(fleet)
    if kind == "relaxed" and fleet.active:
        bounds = relaxed(fleet, path)
    if kind == "unbounded range":
        bounds = strict_bounds(replace(fleet, communication_range=np.inf))
    assert bounds.keeps_mixed(path, other) == keeps_mixed_one_by_one(bounds, path, other)


@pytest.mark.parametrize("lost", [(), (1,), (0, 2)])
def test_some_mixed_motions_are_safe_and_some_tear_or_collide(lost):
    verdicts = Counter()
    for seed in range(60):
        fleet, path, other = random_motions(seed, 4, lost)
        for name, changes in (("apart", {"communication_range": np.inf}), ("in touch", {"separation_min": 0.0})):
            bounds = strict_bounds(replace(fleet, **changes))
            verdict = bounds.keeps_mixed(path, other)
            assert verdict == keeps_mixed_one_by_one(bounds, path, other)
            verdicts[name, verdict] += 1
    assert len(verdicts) == 4
    assert min(verdicts.values()) >= 5


@settings(max_examples=100)
@given(cases())
def test_pairs_that_are_too_near_are_found_as_pair_by_pair(case):
    fleet, path, _ = case
    if not fleet.active:
        return
    expected = {pair: value for pair, value in one_by_one(path, fleet).items() if value < fleet.separation_min}
    bounds = relaxed(fleet, path)
    assert bounds.pair_separation == pytest.approx(expected, abs=1e-12)
    assert bounds.planned.separations.min(initial=np.inf) >= 0.0


@given(cases())
def test_a_motion_keeps_the_bounds_that_it_attains_and_none_that_ask_more_of_a_pair(case):
    fleet, path, _ = case
    if not fleet.active:
        return
    start, speed = path.position[0], path.velocity[0]
    force = np.repeat(-speed[None] / (3.0 * PERIOD), 3, axis=0)  # to rest
    braking = Path(path.time, *roll_out(start, speed, force, PERIOD), force)
    bounds = relaxed(fleet, braking)
    assert bounds.keeps(braking, (start, speed))
    for pair, value in bounds.pair_separation.items():
        asked = {**bounds.pair_separation, pair: value + 0.01}
        assert not MotionBounds(bounds.fleet, asked).keeps(braking, (start, speed))
