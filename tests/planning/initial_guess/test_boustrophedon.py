"""Guesses sweep what is owed."""

from __future__ import annotations

import numpy as np
import pytest
from flights import fleet_of
from motions import PERIOD, grid

from mpc_cover.coverage.objective import coverage_cost
from mpc_cover.mission.load import load_mission
from mpc_cover.model.sensing import measured
from mpc_cover.planning.initial_guess.boustrophedon import frame_of_area, sweep_guesses
from mpc_cover.planning.initial_guess.guess import GuessKind, rest_guess
from mpc_cover.planning.initial_guess.tour import tour_guess
from mpc_cover.planning.initial_guess.waypoint_tracking import track_waypoints


@pytest.mark.parametrize("name", ["box-3"])
def test_sweeps_and_tours_cover_nearly_everything_as_they_fly(name):
    mission = load_mission(name)
    fleet, cell = mission.fleet, mission.field.cell
    owed = np.ones((1, cell.shape[0]))
    kinds = set()
    for guess in [*sweep_guesses(fleet, cell, owed, fleet.start, PERIOD), tour_guess(fleet, cell, owed, fleet.start)]:
        flight = track_waypoints(guess.paths, fleet.start, np.zeros_like(fleet.start), fleet, PERIOD)
        seen = np.any([measured(q, cell, fleet.radius) for q in flight.position], axis=0)
        kinds.add(guess.origin.kind)
        assert seen.mean() > 0.9, guess.origin.name
    assert kinds == {GuessKind.STRIPS, GuessKind.SNAKE, GuessKind.COMB, GuessKind.TOUR}


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


def test_the_cost_of_a_complete_sweep_is_near_zero():
    mission = load_mission("box-3")
    fleet, cell = mission.fleet, mission.field.cell
    owed = np.ones((1, cell.shape[0]))
    guess = next(iter(sweep_guesses(fleet, cell, owed, fleet.start, PERIOD)))
    flight = track_waypoints(guess.paths, fleet.start, np.zeros_like(fleet.start), fleet, PERIOD)
    assert coverage_cost(flight.position, cell, fleet.radius, owed) < 2.0


@pytest.mark.parametrize("degrees", [17.0, 45.0, 120.0])
def test_sweeps_follow_the_axes_of_a_turned_rectangle(degrees):
    turn = np.array(
        [
            [np.cos(np.radians(degrees)), -np.sin(np.radians(degrees))],
            [np.sin(np.radians(degrees)), np.cos(np.radians(degrees))],
        ]
    )
    x, y = np.meshgrid(np.arange(0.0, 12.0, 0.5), np.arange(0.0, 4.0, 0.5))
    axes = frame_of_area(np.column_stack([x.ravel(), y.ravel()]) @ turn.T)
    along = turn[:, 0]
    assert np.abs(axes @ along).max() == pytest.approx(1.0, abs=1e-6)
    np.testing.assert_allclose(axes @ axes.T, np.eye(2), atol=1e-12)


def test_areas_along_the_axes_and_areas_without_extent_are_swept_along_them():
    x, y = np.meshgrid(np.arange(5.0), np.arange(3.0))
    for cell in (np.column_stack([x.ravel(), y.ravel()]), np.zeros((1, 2)), np.column_stack([np.arange(9.0)] * 2)):
        np.testing.assert_array_equal(frame_of_area(cell), np.eye(2))
