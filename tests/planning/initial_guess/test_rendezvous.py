"""Those who are out of range of each other come nearer, and meet; nobody else is lost or hit on the way."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from flights import fleet_of
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from mpc_cover.control.constraint_relaxation import attainable_bounds, longest_edge
from mpc_cover.control.obstacle_trajectories import path_among
from mpc_cover.model.braking import braking_trajectory
from mpc_cover.model.fleet_state import FleetState
from mpc_cover.planning.initial_guess.rendezvous import Rendezvous, out_of_range
from mpc_cover.planning.task import Task

PERIOD = 0.5


def fleet_at(start, lost=(), reach=4.0):
    return fleet_of(np.asarray(start, dtype=float), separation_min=0.5, communication_range=reach, lost=tuple(lost))


def state_of(fleet, velocity):
    """Return the state at the fleet's start with these velocities, at 3 s."""
    lost = np.isin(np.arange(fleet.size), fleet.lost)
    return replace(FleetState.nominal(fleet.start, velocity, 3.0), lost=lost)


def braking_from(state, fleet):
    return path_among(braking_trajectory(state.position, state.velocity, fleet, 3.0, PERIOD, 8), state)


def reunite(fleet, velocity):
    """Return the bounds that hold from the fleet's start with these velocities, and the first plan that keeps them."""
    state = state_of(fleet, velocity)
    bounds = attainable_bounds(fleet, [braking_from(state, fleet)], state.actual)
    nothing = np.zeros((0, fleet.dimension)), np.zeros((1, 0))
    task = Task(fleet, *nothing, state.position, state.velocity, state.time, PERIOD)
    plans = (guess.motion for guess in Rendezvous().guesses(task))
    return bounds, next((plan for plan in plans if bounds.keeps(path_among(plan, state), state.actual)), None)


@settings(max_examples=60, deadline=None)
@given(st.integers(2, 6), st.integers(0, 2**32 - 1), st.booleans())
def test_whoever_is_apart_meets_and_was_never_farther_apart_than_braking_leaves_them(agents, seed, moving):
    rng = np.random.default_rng(seed)
    start = rng.uniform(0.0, 14.0, (agents, 2))
    distance = np.linalg.norm(start[:, None] - start, axis=2) + 10.0 * np.eye(agents)
    assume(distance.min() > 2.5)  # nobody collides, whatever they do in the time of braking
    fleet = fleet_at(start)
    assume(out_of_range(start, fleet))
    velocity = rng.uniform(-0.7, 0.7, (agents, 2)) if moving else np.zeros((agents, 2))
    bounds, plan = reunite(fleet, velocity)
    assert plan is not None
    state = state_of(fleet, velocity)
    braked = longest_edge(braking_from(state, fleet), fleet)
    assert longest_edge(path_among(plan, state), fleet) <= max(fleet.communication_range, braked) + 1e-5
    assert not out_of_range(plan.position[-1], fleet)
    assert bounds.fleet.communication_range <= max(fleet.communication_range, braked) + 1e-5


def test_the_lost_relay_in_the_middle_is_flown_around():
    """Two groups must pass each other's obstacles: the dead stand between them, and they meet all the same."""
    start = [[0.0, 0.0], [3.0, 0.0], [6.0, 0.0], [9.0, 0.0]]
    fleet = fleet_at(start, lost=(1, 2), reach=3.5)
    _, plan = reunite(fleet, np.zeros((4, 2)))
    assert plan is not None
    assert np.linalg.norm(plan.position[-1, 0] - plan.position[-1, 3]) <= 3.5
    assert not np.abs(plan.velocity[:, 1:3]).any()


def test_a_fleet_in_touch_is_not_apart_and_the_lost_do_not_count():
    fleet = fleet_at([[0.0, 0.0], [3.0, 0.0], [6.0, 0.0]])
    assert not out_of_range(fleet.start, fleet)
    assert out_of_range(fleet.start, replace(fleet, lost=(1,)))
    assert not out_of_range(fleet.start, replace(fleet, lost=(2,)))


def test_a_link_that_is_too_long_is_closed_though_others_keep_both_in_touch():
    """As when the tube leaves less of the range than the start needs: the tree is well, one pair's own link is not."""
    start = [[0.66, 3.25], [1.45, 3.39], [0.9, 2.57], [1.48, 2.16]]
    fleet = replace(fleet_at(start, reach=1.32), links=((3, 0),))
    assert out_of_range(fleet.start, fleet)
    assert not out_of_range(fleet.start, replace(fleet, links=()))
    _, plan = reunite(fleet, np.zeros((4, 2)))
    assert plan is not None
    assert not out_of_range(plan.position[-1], fleet)
    drifting = np.zeros((4, 2))
    drifting[3, 0] = 0.3  # away: braking alone makes it longer, which cannot be helped
    bounds, plan = reunite(fleet, drifting)
    assert bounds.fleet.communication_range > np.linalg.norm(fleet.start[3] - fleet.start[0])
    assert plan is not None
    assert not out_of_range(plan.position[-1], fleet)
