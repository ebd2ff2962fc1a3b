"""Room to stop: encounters against motions flown out here, rows against finite differences."""

from __future__ import annotations

import numpy as np
import pytest
from flights import fleet_of
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from mpc_cover.constraints.passive_safety import (
    braking_encounters,
    braking_violations,
    passive_safety_rows,
    stop_instants,
)
from mpc_cover.constraints.rows import Layout
from mpc_cover.model.motion import roll_out

PERIOD = 0.5
EVERYTHING = 1e3


def motion_of(rng, agents, steps, *, size=4.0):
    """Return a random motion that ends at rest, and its fleet."""
    start = rng.uniform(0.0, size, (agents, 2))
    velocity = np.cumsum(rng.uniform(-0.5, 0.5, (steps + 1, agents, 2)), axis=0)
    velocity[-1] = 0.0
    position, _ = roll_out(start, velocity[0], np.diff(velocity, axis=0) / PERIOD, PERIOD)
    return position, velocity, start


def one_behind_the_other(gap, speed=1.0, steps=12):
    """Return two agents one behind the other, as fast."""
    velocity = np.zeros((steps + 1, 2, 2))
    velocity[1:-1, :, 0] = speed
    start = np.array([[0.0, 0.0], [gap, 0.0]])
    position, _ = roll_out(start, velocity[0], np.diff(velocity, axis=0) / PERIOD, PERIOD)
    return position, velocity, start


@pytest.mark.parametrize("gap", [1.2, 1.7, 2.5])
def test_a_follower_comes_as_much_nearer_as_it_flies_before_it_knows(gap):
    position, velocity, start = one_behind_the_other(gap)
    fleet = fleet_of(start, separation_min=0.5, reaction_periods=2.0)
    (moment,) = stop_instants(fleet.reaction_periods)
    found = braking_encounters(position, velocity, PERIOD, fleet, moment, EVERYTHING)
    behind = found.distance[(found.stopper == 1) & (found.sample == 4)]
    assert behind == pytest.approx(gap - 1.0)  # two periods at 1 m/s; both brake alike
    ahead = found.distance[(found.stopper == 0) & (found.sample == 4)]
    assert ahead == pytest.approx(gap)
    assert (braking_violations(position, velocity, PERIOD, fleet).max() > 0.0) == (gap < 1.6)


def test_nobody_who_stops_is_expected_without_a_reaction_time():
    position, velocity, start = one_behind_the_other(0.6)
    assert braking_violations(position, velocity, PERIOD, fleet_of(start, separation_min=0.5)).size == 0


def test_the_lost_and_lone_agents_need_no_room():
    position, velocity, start = one_behind_the_other(0.6)
    position[:, 1], velocity[:, 1] = position[0, 1] + 5.0, 0.0
    fleet = fleet_of(start, separation_min=0.5, reaction_periods=2.0, lost=(1,))
    assert braking_encounters(position, velocity, PERIOD, fleet, stop_instants(2.0)[0], EVERYTHING).sample.size == 0


@pytest.mark.parametrize(("reaction", "expected"), [(0.0, []), (2.0, [(2, 0.0)]), (2.25, [(3, 0.75), (2, 0.0)])])
def test_worst_moments_to_die(reaction, expected):
    assert stop_instants(reaction) == expected


def flown_out(position, velocity, fleet, sample, stopper, moment):
    """Return the least distance (m,) to a stopper of everyone else, step by tiny step."""
    fine, step = 200, PERIOD / 200
    dead_at, known_at = (sample + moment.part) * PERIOD, (sample + moment.lag) * PERIOD
    place, speed = position[sample].copy(), velocity[sample].copy()
    least = np.full(len(place), np.inf)
    for tick in range(fine * (moment.lag + 8)):
        now = sample * PERIOD + tick * step
        row = min(int(now / PERIOD + 1e-9), len(velocity) - 2)
        force = (velocity[row + 1] - velocity[row]) / PERIOD if now < PERIOD * (len(velocity) - 1) - 1e-9 else 0 * speed
        brakes = np.full(len(place), now >= known_at - 1e-9)
        brakes[stopper] = now >= dead_at - 1e-9
        pace = np.linalg.norm(speed, axis=1)
        hard = -np.minimum(fleet.input_max, pace / step)[:, None] * speed / np.maximum(pace, 1e-12)[:, None]
        force = np.where(brakes[:, None], hard, force)
        place, speed = place + step * speed + 0.5 * step**2 * force, speed + step * force
        if now >= dead_at - 1e-9:
            least = np.minimum(least, np.linalg.norm(place - place[stopper], axis=1))
    return least


@settings(max_examples=25, deadline=None)
@given(st.integers(2, 4), st.integers(0, 2**32 - 1), st.sampled_from([2.0, 2.3, 3.8]))
def test_encounters_are_those_of_a_motion_that_is_flown_out(agents, seed, reaction):
    rng = np.random.default_rng(seed)
    position, velocity, start = motion_of(rng, agents, 8)
    fleet = fleet_of(start, separation_min=0.4, reaction_periods=reaction)
    for moment in stop_instants(reaction):
        found = braking_encounters(position, velocity, PERIOD, fleet, moment, EVERYTHING)
        case = int(rng.integers(found.sample.size))
        sample, stopper = int(found.sample[case]), int(found.stopper[case])
        least = flown_out(position, velocity, fleet, sample, stopper, moment)[found.follower[case]]
        # between the instants that are looked at, a distance changes by no more than this
        fastest = 2.0 * np.linalg.norm(velocity, axis=2).max()
        assert found.distance[case] - fastest * PERIOD / 4 <= least <= found.distance[case] + 0.02


@settings(max_examples=25, deadline=None)
@given(st.integers(2, 4), st.integers(0, 2**32 - 1), st.floats(0.0, 1.0))
def test_no_encounter_is_left_out(agents, seed, reach):
    position, velocity, start = motion_of(np.random.default_rng(seed), agents, 8)
    fleet = fleet_of(start, separation_min=0.4, reaction_periods=2.3)
    for moment in stop_instants(fleet.reaction_periods):
        every = braking_encounters(position, velocity, PERIOD, fleet, moment, EVERYTHING)
        some = braking_encounters(position, velocity, PERIOD, fleet, moment, reach)
        assert some.sample.size == np.count_nonzero(every.distance < every.required + reach)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from([2.0, 2.3]))
def test_rows_are_the_gradient_of_the_distance(seed, reaction):
    rng = np.random.default_rng(seed)
    position, velocity, start = motion_of(rng, 3, 8)
    fleet, layout = fleet_of(start, separation_min=0.4, reaction_periods=reaction), Layout(8, 3, 2)
    change = 1e-6 * rng.normal(size=(2, *position.shape))
    change[1, -1] = 0.0  # it ends at rest still
    for moment in stop_instants(reaction):
        found = braking_encounters(position, velocity, PERIOD, fleet, moment, EVERYTHING)
        rows = passive_safety_rows(layout, position, velocity, PERIOD, fleet, found)
        moved = braking_encounters(position + change[0], velocity + change[1], PERIOD, fleet, moment, EVERYTHING)
        along = np.bincount(rows.row, rows.value * change.ravel()[rows.column], found.sample.size)
        same = (found.later == moved.later) & (found.distance > 0.05)
        assume(same.any())
        assert -along[same] == pytest.approx(moved.distance[same] - found.distance[same], abs=2e-9)
        iterate = np.concatenate([position.ravel(), velocity.ravel()])
        reached = np.bincount(rows.row, rows.value * iterate[rows.column], found.sample.size)
        assert rows.upper - reached == pytest.approx(found.distance - found.required)
