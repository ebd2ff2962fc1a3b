"""Towing brings some agent near a cell that no rigid formation reaches, and keeps every constraint on the way."""

from itertools import product

import numpy as np
import pytest
from flights import fleet_of
from motions import PERIOD, UNLIMITED

from mpc_cover.planning.candidate import evaluate_guess
from mpc_cover.planning.free_horizon import plan_free_horizon
from mpc_cover.planning.initial_guess.formation import formation_flight
from mpc_cover.planning.initial_guess.towing import Towing
from mpc_cover.planning.task import Task
from solvers.backends.registry import make_backend

STAR = 4.0 + np.array([[0.0, 0.0], [1.1, 0.0], [-1.1, 0.0], [0.0, 1.1], [0.0, -1.1]])
BENT = 3.0 + np.array([[0.0, 0.0], [1.05, 0.0], [2.1, 0.0], [2.1, 1.05], [2.1, 2.1]])


def to_corner(start, reach, corner):
    fleet = fleet_of(
        start,
        separation_min=1.0,
        communication_range=reach,
        motion_min=np.zeros(2),
        motion_max=np.full(2, 8.0),
        radius=np.full((len(start), 1), 0.7),
    )
    return Task(fleet, np.array([corner]), np.ones((1, 1)), start, np.zeros_like(start), 0.0, PERIOD)


@pytest.mark.parametrize("corner", list(product((0.1, 7.9), repeat=2)))
@pytest.mark.parametrize(("start", "reach"), [(STAR, 1.15), (STAR, 1.25), (BENT, 1.08)], ids=["star", "wide", "bent"])
def test_every_corner_is_reached(start, reach, corner):
    task = to_corner(start, reach, corner)
    found = [evaluate_guess(task, guess) for guess in Towing().guesses(task)]
    assert any(candidate.feasible and candidate.cost == 0.0 for candidate in found)


def test_a_plan_leads_the_fleet_to_what_no_formation_reaches():
    task = to_corner(STAR, 1.15, (0.1, 0.1))
    assert formation_flight(task, UNLIMITED) is None
    assert plan_free_horizon(task, make_backend("piqp"), attempts=1, budget=UNLIMITED).covers


def test_nobody_is_towed_where_links_are_long():
    assert list(Towing().guesses(to_corner(STAR, 6.0, (0.1, 0.1)))) == []
