"""Plans that agents may hold: whatever messages are lost, nobody comes too near to anybody."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from flights import fleet_of
from hypothesis import given
from hypothesis import settings as examples
from hypothesis import strategies as st

from mpc_cover.control.held_plans import crossing, separation_from_held
from mpc_cover.model.fleet_state import FleetState
from mpc_cover.model.trajectory import Trajectory

PERIOD, AGENTS, ROUNDS, APART = 0.5, 3, 3, 0.5
START = np.array([[0.0, 0.0], [1.2, 0.0], [0.6, 1.0]])
FLEET = fleet_of(START, separation_min=APART)


def random_plan(rng, state, steps=6):
    """Return a plan from a state: full inputs in some direction, then the velocity falls to zero."""
    heading = rng.uniform(-np.pi, np.pi, AGENTS)
    target = rng.uniform(0.0, 1.2, AGENTS)[:, None] * np.stack([np.cos(heading), np.sin(heading)], axis=1)
    part = np.linspace(0.0, 1.0, steps + 1)[1:, None, None]
    later = (1.0 - part) * (state.velocity + np.minimum(1.0, 3.0 * part) * (target - state.velocity))
    return state.trajectory(later, PERIOD)


def at(motion, time_s):
    return motion.at(time_s, 1e-9)


@examples(deadline=None, max_examples=60)
@given(seed=st.integers(0, 10_000))
def test_distances_are_those_along_the_continuous_paths(seed):
    rng = np.random.default_rng(seed)
    state = FleetState.nominal(START, np.zeros_like(START), 1.0)
    plan, other = random_plan(rng, state), random_plan(rng, state, steps=4)
    held = {1: [other.agent(1).shift(0.3)], 2: [plan.agent(2), other.agent(2)]}
    found = separation_from_held(plan, replace(state, held=held))
    time = np.linspace(plan.start_time, plan.end_time, 4001)
    assert np.isinf(found[:, 0]).all()
    for index, motions in held.items():
        sampled = [np.linalg.norm(at(plan, time)[0] - at(one, time)[0][:, None], axis=2).min(axis=0) for one in motions]
        expected = np.min(sampled, axis=0)
        assert np.isinf(found[index, index])
        for agent in set(range(AGENTS)) - {index}:
            assert found[agent, index] == pytest.approx(expected[agent], abs=2e-3)
            assert found[agent, index] <= expected[agent] + 1e-9


def rounds(seed):
    """Return the plans that are admitted in rounds of which the controller hears nothing again, a period apart."""
    rng = np.random.default_rng(seed)
    state = FleetState.nominal(START, np.zeros_like(START), 0.0)
    held = {index: [Trajectory.at_rest(START[index], 0.0, PERIOD, 1)] for index in range(AGENTS)}
    sent = []
    for number in range(ROUNDS):
        for _ in range(60):
            plan = random_plan(rng, state)
            own = separation_from_held(plan, replace(state, held={i: [plan.agent(i)] for i in range(AGENTS)}))
            if own.min() >= APART and crossing(plan, replace(state, held=held), FLEET, ()) is None:
                break
        else:
            break
        sent.append(plan)
        held = {index: [*motions, plan.agent(index)] for index, motions in held.items()}
        then = PERIOD * (number + 1)
        state = FleetState.nominal(*at(plan, then), then)
    return sent


def flown(sent, received):
    """Return where the agents are (T, m, d) if each takes up the plans that it receives and that begin where it is."""
    time = np.linspace(0.0, PERIOD * (ROUNDS + 8), 600)
    position = np.repeat(START[None], len(time), axis=0)
    for agent in range(AGENTS):
        current = Trajectory.at_rest(START[agent], 0.0, PERIOD, 1)
        for plan, there in zip(sent, received, strict=True):
            part, begin = plan.agent(agent), plan.start_time
            gaps = [
                np.abs(ours - theirs).max() for ours, theirs in zip(at(part, begin), at(current, begin), strict=True)
            ]
            if there[agent] and max(gaps) < 1e-9:
                current = part
                position[time >= begin, agent] = at(current, time[time >= begin])[0]
    return position


@pytest.mark.parametrize("seed", range(4))
def test_all_patterns_of_lost_messages_of_three_agents_in_three_rounds_keep_them_apart(seed):
    sent = rounds(seed)
    assert sent
    one, two = np.triu_indices(AGENTS, k=1)
    for pattern in product((False, True), repeat=AGENTS * len(sent)):
        position = flown(sent, np.array(pattern).reshape(len(sent), AGENTS))
        assert np.linalg.norm(position[:, one] - position[:, two], axis=2).min() >= APART - 1e-6


def test_without_it_some_pattern_brings_them_too_near():
    """What the test above tells apart: agents that swap places are apart only if both go."""
    start = FleetState.nominal(START, np.zeros_like(START), 0.0)
    ring = START[[1, 2, 0]] - START
    part = np.array([0.5, 1.0, 1.0, 0.5, 0.0])[:, None, None] / 3.0
    plan = start.trajectory(ring / PERIOD * part, PERIOD)
    held = {index: [Trajectory.at_rest(START[index], 0.0, PERIOD, 1)] for index in range(AGENTS)}
    told = crossing(plan, replace(start, held=held), FLEET, ())
    assert told is not None
    assert "a plan that a" in told
    position = flown([plan], np.array([[True, False, False]]))
    assert np.linalg.norm(position[:, 0] - position[:, 1], axis=1).min() < APART


def test_what_is_flown_otherwise_is_the_measure_where_there_is_no_room():
    state = FleetState.nominal(START, np.zeros_like(START), 0.0)
    beside = {1: [Trajectory.at_rest(np.array([0.3, 0.0]), 0.0, PERIOD, 1)]}
    crowded = replace(state, held=beside)
    stays = Trajectory.at_rest(START, 0.0, PERIOD, 4)
    assert crossing(stays, crowded, FLEET, ()) is not None
    assert crossing(stays, crowded, FLEET, [stays]) is None
    nearer = state.trajectory(np.array([[[0.1, 0.0]] * 3, [[0.0, 0.0]] * 3]), PERIOD)
    assert crossing(nearer, crowded, FLEET, [stays]) is not None
    away = Trajectory.at_rest(START + np.array([5.0, 5.0]), 0.0, PERIOD, 4)
    assert crossing(stays, crowded, FLEET, [stays, away]) is not None, "one that is apart leaves no excuse"


def test_tight_fleets_are_eased_only_while_it_is_known_what_everyone_flies():
    state = FleetState.nominal(START, np.zeros_like(START), 0.0)
    one, other = (Trajectory.at_rest(START[1] + off, 0.0, PERIOD, 1) for off in (0.0, 0.2))
    plan = Trajectory.at_rest(START, 0.0, PERIOD, 4)
    assert crossing(plan, replace(state, held={1: [one]}), FLEET, (), eased=True) is None
    assert crossing(plan, replace(state, held={1: [one, other]}), FLEET, (), eased=True) is not None
