"""Guesses fly within the limits, come to rest, and sweep what is owed."""

from __future__ import annotations

import numpy as np
import pytest
from flights import fleet_of
from hypothesis import given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st
from motions import PERIOD, grid

from mpc_cover.coverage.objective import coverage_cost
from mpc_cover.mission.load import load_mission
from mpc_cover.model.sensing import measured
from mpc_cover.planning.initial_guess.boustrophedon import rest_guess, sweep_guesses, tour_guess
from mpc_cover.planning.initial_guess.lanes import assign, assign_pieces, cut_lanes, cut_snake, strips, swath_of
from mpc_cover.planning.initial_guess.waypoint_tracking import track_waypoints
from mpc_cover.planning.segment_refinement import resampled
from mpc_cover.verification.motion import verify_motion


def verified(flight, fleet):
    force = np.diff(flight.velocity, axis=0) / PERIOD
    time = PERIOD * np.arange(flight.steps + 1)
    return verify_motion(fleet, time, flight.position, flight.velocity, force, at_rest=True)


@hypothesis_settings(max_examples=40)
@given(seed=st.integers(0, 10**6), steps=st.one_of(st.none(), st.integers(4, 30)))
def test_following_random_waypoints_keeps_all_limits_and_ends_at_rest(seed, steps):
    rng = np.random.default_rng(seed)
    agents = int(rng.integers(1, 4))
    start = rng.uniform(0.5, 9.5, (agents, 2))
    fleet = fleet_of(
        start,
        input_max=rng.uniform(0.5, 2.0, agents),
        speed_max=rng.uniform(0.5, 2.0, agents),
        motion_min=np.zeros(2),
        motion_max=np.full(2, 10.0),
    )
    paths = [rng.uniform(0.5, 9.5, (int(rng.integers(1, 5)), 2)) for _ in range(agents)]
    flight = track_waypoints(paths, start, np.zeros_like(start), fleet, PERIOD, steps=steps)
    report = verified(flight, fleet)
    assert report.holds, report.first_failure
    if steps is not None:
        assert flight.steps == steps


def test_without_a_number_of_steps_it_arrives():
    start = np.array([[1.0, 1.0]])
    flight = track_waypoints([np.array([[8.0, 1.0], [8.0, 6.0]])], start, np.zeros((1, 2)), fleet_of(start), PERIOD)
    assert flight.position[-1, 0] == pytest.approx([8.0, 6.0], abs=0.6)


@hypothesis_settings(max_examples=60)
@given(seed=st.integers(0, 10**6), period=st.sampled_from([0.2, 0.5, 1.0, 2.0]))
def test_it_arrives_in_time_however_far_it_goes_in_a_sample(seed, period):
    rng = np.random.default_rng(seed)
    start, speed, force = rng.uniform(0.0, 6.0, (1, 2)), rng.uniform(0.2, 2.0), rng.uniform(0.3, 3.0)
    fleet = fleet_of(start, input_max=np.array([force]), speed_max=np.array([speed]))
    path = rng.uniform(0.0, 6.0, (int(rng.integers(1, 12)), 2))
    flight = track_waypoints([path], start, np.zeros_like(start), fleet, period)
    length = float(np.linalg.norm(np.diff(np.concatenate([start, path]), axis=0), axis=1).sum())
    turns = (len(path) + 1) * (2.0 * speed / force + 2.0 * period)
    assert flight.steps * period < 2.0 * (length / speed + turns)


@pytest.mark.parametrize("name", ["box-3"])
def test_sweeps_and_tours_cover_nearly_everything_as_they_fly(name):
    mission = load_mission(name)
    fleet, cell = mission.fleet, mission.field.cell
    owed = np.ones((1, cell.shape[0]))
    kinds = set()
    for guess in [*sweep_guesses(fleet, cell, owed, fleet.start, PERIOD), tour_guess(fleet, cell, owed, fleet.start)]:
        flight = track_waypoints(guess.paths, fleet.start, np.zeros_like(fleet.start), fleet, PERIOD)
        seen = np.any([measured(q, cell, fleet.radius) for q in flight.position], axis=0)
        kinds.add(guess.kind.split()[0])
        assert seen.mean() > 0.9, guess.kind
    assert kinds == {"strips", "snake", "comb", "tour"}


def test_a_tour_visits_what_is_left_over_with_whoever_can_measure_it():
    start = np.array([[0.0, 0.0], [9.0, 0.0]])
    fleet = fleet_of(start, radius=np.array([[1.0, -np.inf], [-np.inf, 1.0]]))
    owed = np.array([[0.0, 1.0], [1.0, 0.0]])
    cell = np.array([[1.0, 5.0], [8.0, 5.0]])
    guess = tour_guess(fleet, cell, owed, start)
    assert guess.paths[0][-1].tolist() == [8.0, 5.0]
    assert guess.paths[1][-1].tolist() == [1.0, 5.0]


def test_with_nothing_owed_everybody_stays():
    start = np.array([[1.0, 2.0]])
    fleet = fleet_of(start)
    assert tour_guess(fleet, grid(2), np.zeros((1, 4)), start).paths[0].tolist() == [[1.0, 2.0]]
    assert rest_guess(start).paths[0].tolist() == [[1.0, 2.0]]


def test_lanes_are_as_few_as_the_swath_allows_and_leave_no_cell_out():
    swath = swath_of(1.0, 1.5, PERIOD)
    assert swath.half_width == pytest.approx(np.sqrt(1.0 - 0.375**2))
    cell = grid(20, 0.5)
    lanes = cut_lanes(cell, swath, 0)
    across = np.array([lane.low[1] for lane in lanes])
    assert len(lanes) == 5  # four rows of half a metre each
    assert np.abs(cell[:, 1][:, None] - across).min(axis=1).max() <= swath.half_width
    assert all(lane.low[1] == lane.high[1] for lane in lanes)
    assert len(cut_lanes(cell, swath, 0, count=6)) == 6
    assert cut_lanes(np.array([[1.0, 1.0]]), swath, 0)[0].low.tolist() == [1.0, 1.0]


def test_a_cut_snake_is_one_path_in_pieces_of_the_shares_asked_for():
    lanes = cut_lanes(grid(20, 0.5), swath_of(1.0, 1.5, PERIOD), 0)
    pieces = cut_snake(lanes, np.array([1.0, 2.0]), mirrored=False, upward=True)
    length = [np.linalg.norm(np.diff(piece, axis=0), axis=1).sum() for piece in pieces]
    assert length[1] == pytest.approx(2.0 * length[0])
    assert pieces[0][-1] == pytest.approx(pieces[1][0])


def test_pieces_go_to_whoever_is_near_in_the_better_direction():
    pieces = [np.array([[0.0, 0.0], [4.0, 0.0]]), np.array([[9.0, 9.0], [5.0, 9.0]])]
    flown = assign_pieces(pieces, np.array([[5.0, 8.0], [4.0, 1.0]]), np.ones(2))
    assert flown[0][0].tolist() == [5.0, 9.0]
    assert flown[1][0].tolist() == [4.0, 0.0]


def test_strips_share_out_in_proportion():
    parts = strips(grid(10), np.array([3.0, 1.0]), 0)
    assert [len(part) for part in parts] == [75, 25]
    assert parts[0][:, 0].max() <= parts[1][:, 0].max()


@pytest.mark.parametrize("agents", [3, 8])
def test_assignment_is_a_permutation_and_takes_the_obvious_one(agents):
    start = np.stack([np.arange(agents), np.zeros(agents)], axis=1)
    goal = start[::-1] + np.array([0.0, 0.5])
    assert assign(start, goal) == list(range(agents))[::-1]


def test_resampling_plays_the_same_path_faster():
    velocity = np.zeros((11, 1, 2))
    velocity[1:-1, 0, 0] = 1.0
    faster = resampled(velocity, 8)
    assert faster.shape == (9, 1, 2)
    assert faster[:, 0, 0].sum() == pytest.approx(velocity[:, 0, 0].sum(), rel=0.05)
    assert faster[-1].tolist() == [[0.0, 0.0]]


def test_the_cost_of_a_complete_sweep_is_near_zero():
    mission = load_mission("box-3")
    fleet, cell = mission.fleet, mission.field.cell
    owed = np.ones((1, cell.shape[0]))
    guess = next(iter(sweep_guesses(fleet, cell, owed, fleet.start, PERIOD)))
    flight = track_waypoints(guess.paths, fleet.start, np.zeros_like(fleet.start), fleet, PERIOD)
    assert coverage_cost(flight.position, cell, fleet.radius, owed) < 2.0
