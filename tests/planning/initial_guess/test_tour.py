"""The greedy tour: it visits what somebody can measure, and leaves what nobody can."""

import numpy as np
from flights import mission_of
from tiny_mission import TINY

from mpc_cover.model.fleet_constraints import FleetConstraints
from mpc_cover.planning.initial_guess.guess import GuessKind
from mpc_cover.planning.initial_guess.tour import tour_guess, tour_or_strips
from mpc_cover.planning.task import Task


def fleet_of(radius):
    mission = mission_of({**TINY, "fleet": {**TINY["fleet"], "communication_range_m": 9.0}})
    return FleetConstraints.of(mission.fleet, radius=np.array(radius))


def test_what_nobody_can_measure_is_left():
    fleet = fleet_of([[1.0, -np.inf], [-np.inf, -np.inf]])
    cell = np.array([[0.5, 2.5], [2.5, 2.5]])
    guess = tour_guess(fleet, cell, np.ones((2, 2)), fleet.start)
    reached = np.linalg.norm(cell[:, None] - guess.paths[0][None], axis=2).min(axis=1)
    assert (reached <= 1.0).all()
    np.testing.assert_array_equal(guess.paths[1], fleet.start[1:])


def test_nobody_sets_out_where_nobody_can_measure():
    fleet = fleet_of([[-np.inf], [-np.inf]])
    guess = tour_guess(fleet, np.ones((3, 2)), np.ones((1, 3)), fleet.start)
    np.testing.assert_array_equal(np.concatenate(guess.paths), fleet.start)


def test_thousands_of_cells_are_swept_instead():
    fleet = fleet_of([[1.0], [1.0]])
    for side, kind in ((30, GuessKind.TOUR), (60, GuessKind.STRIPS)):
        cell = np.stack(np.meshgrid(*[np.arange(side) * 0.5] * 2), axis=-1).reshape(-1, 2)
        still = np.zeros_like(fleet.start)
        task = Task(fleet, cell, np.ones((1, len(cell))), fleet.start, still, 0.0, 0.5)
        assert tour_or_strips(task).origin.kind is kind
