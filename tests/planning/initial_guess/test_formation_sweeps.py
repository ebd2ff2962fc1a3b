"""A tightly linked fleet sweeps in formation: every guess is a plan that keeps all constraints, wherever it starts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from flights import fleet_of
from hypothesis import given, settings
from hypothesis import strategies as st
from motions import PERIOD, grid

from mpc_cover.planning.initial_guess.formation_sweeps import FormationSweeps
from mpc_cover.planning.initial_guess.guess import GuessKind
from mpc_cover.planning.task import End, Task
from mpc_cover.verification.motion import verify_motion

APART = 1.0


def block(columns, rows, spacing=1.05):
    return 1.0 + spacing * np.array([[i, j] for j in range(rows) for i in range(columns)], dtype=float)


def tight(start, reach, side=8.0, **changes):
    """Return all of a square or cube to be covered by a fleet that is hardly farther apart than it must be."""
    dimension = start.shape[1]
    fleet = fleet_of(
        start,
        separation_min=APART,
        communication_range=reach,
        motion_min=np.zeros(dimension),
        motion_max=np.full(dimension, side),
        **changes,
    )
    spacing = 0.5 if dimension == 2 else 1.0
    cell = grid(round(side / spacing), spacing, dimension)
    return Task(fleet, cell, np.ones((1, len(cell))), start, np.zeros_like(start), 0.0, PERIOD)


def assert_flyable(task, motion):
    time = PERIOD * np.arange(motion.steps + 1)
    report = verify_motion(
        task.fleet,
        time,
        motion.position,
        motion.velocity,
        motion.input,
        tolerance=1e-6,
        at_rest=True,
        start=(task.position, task.velocity),
    )
    assert report.holds, report.failures


@st.composite
def clusters(draw):
    """Draw feasible starts: each agent within range of an earlier one, and no pair too near."""
    rng = np.random.default_rng(draw(st.integers(0, 2**31)))
    dimension, agents = draw(st.sampled_from([2, 2, 3])), draw(st.integers(2, 6))
    reach = draw(st.sampled_from([1.03, 1.1, 1.3, 1.7]))
    places = [rng.uniform(2.0, 4.0, dimension)]
    while len(places) < agents:
        way = rng.normal(size=dimension)
        place = places[rng.integers(len(places))] + way / np.linalg.norm(way) * rng.uniform(APART, reach)
        if min(np.linalg.norm(place - other) for other in places) >= APART and (np.abs(place - 3.0) < 2.9).all():
            places.append(place)
    return np.array(places), reach


@settings(max_examples=15, deadline=None)
@given(clusters())
def test_from_every_feasible_start_there_are_sweeps_and_they_keep_all_constraints(cluster):
    task = tight(*cluster, side=6.0)
    guesses = list(FormationSweeps().guesses(task))
    assert guesses
    for guess in guesses:
        assert guess.origin.kind is GuessKind.FORMATION
        assert_flyable(task, guess.motion)
        assert (task.remaining_after(guess.motion) > 0.0).mean() < 0.5


@pytest.mark.parametrize(
    ("columns", "rows", "reach"), [(3, 1, 1.2), (6, 1, 1.2), (3, 2, 1.2), (4, 3, 1.5), (3, 1, 1.06)]
)
def test_a_sweep_of_a_block_covers_everything_as_fast_as_a_line_abreast_might(columns, rows, reach):
    task = tight(block(columns, rows), reach)
    complete = [
        guess.motion for guess in FormationSweeps().guesses(task) if not task.remaining_after(guess.motion).any()
    ]
    # each lane of a line abreast, and as long again for turns, for the way to the first, and for unfolding
    width = min((columns * rows - 1) * reach + 2.0, 8.0)
    lanes = np.ceil(8.0 / width)
    assert min(motion.end_time for motion in complete) <= 2.5 * lanes * 8.0 / 1.5


def test_the_guesses_are_the_same_wherever_the_mission_lies_and_however_large_it_is():
    task = tight(block(3, 2), 1.2)
    here = list(FormationSweeps().guesses(task))
    moved = replace(
        task,
        position=task.position + 1000.0,
        cell=task.cell + 1000.0,
        fleet=replace(
            task.fleet,
            start=task.fleet.start + 1000.0,
            motion_min=task.fleet.motion_min + 1000.0,
            motion_max=task.fleet.motion_max + 1000.0,
        ),
    )
    there = list(FormationSweeps().guesses(moved))
    assert [guess.origin for guess in there] == [guess.origin for guess in here]
    for one, two in zip(here, there, strict=True):
        np.testing.assert_allclose(two.motion.velocity, one.motion.velocity, atol=1e-6)


def test_a_slow_agent_sets_the_pace():
    task = tight(block(3, 1), 1.2, speed_max=np.array([1.5, 0.4, 1.5]))
    for guess in FormationSweeps().guesses(task):
        assert_flyable(task, guess.motion)


@pytest.mark.parametrize(
    "changes",
    [
        {"fleet": replace(tight(block(3, 1), 1.2).fleet, communication_range=4.0)},
        {"velocity": np.full((3, 2), 0.1)},
        {"end": End.FREE},
        {"start_free": True},
        {"weight": np.zeros((1, 256))},
        {"fleet": replace(tight(block(3, 1), 1.2).fleet, radius=np.array([[1.0], [-np.inf], [1.0]]))},
    ],
    ids=["links longer than two lanes", "moving", "free end", "free start", "no demand", "unequal sensors"],
)
def test_no_sweeps_where_there_is_no_formation_to_fly(changes):
    assert list(FormationSweeps().guesses(replace(tight(block(3, 1), 1.2), **changes))) == []


def test_lost_agents_stay_and_fixed_links_hold():
    start = block(3, 1)
    task = tight(start, 1.2, links=((0, 1),))
    for guess in FormationSweeps().guesses(task):
        apart = np.linalg.norm(guess.motion.position[:, 0] - guess.motion.position[:, 1], axis=1)
        assert apart.max() <= 1.2
    lost = tight(np.concatenate([start, [[7.0, 7.0]]]), 1.2, lost=(3,))
    for guess in FormationSweeps().guesses(lost):
        assert not guess.motion.velocity[:, 3].any()
