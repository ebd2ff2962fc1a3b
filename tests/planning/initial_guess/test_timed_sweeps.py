"""Many looks in one go: what is flown brings what is owed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from flights import fleet_of
from motions import EXHAUSTED, PERIOD, UNLIMITED, grid

from mpc_cover.model.sensing import look_counts
from mpc_cover.planning.candidate import evaluate_guess
from mpc_cover.planning.initial_guess.dwell_time_lp import solve_dwell_times, timed_samples
from mpc_cover.planning.initial_guess.guess import Guess, GuessKind, Origin
from mpc_cover.planning.initial_guess.timed_sweeps import repair_sweeps, timed_sweeps
from mpc_cover.planning.initial_guess.waypoint_tracking import track_samples
from mpc_cover.planning.task import Task
from mpc_cover.verification.motion import verify_motion
from solvers.backends.registry import make_backend


def at(*points):
    return np.array(points, dtype=float)


def many_looks(looks=8, agents=2, velocity=0.0, **fleet):
    start = at([0.6, 0.6], [1.6, 0.6])[:agents]
    given_fleet = fleet_of(
        start,
        **{"separation_min": 0.5, "communication_range": 3.0, "motion_min": np.zeros(2), "motion_max": np.full(2, 4.0)}
        | fleet,
    )
    cell = grid(8, 0.5)
    owed = np.full((1, cell.shape[0]), looks)
    return Task(given_fleet, cell, np.ones(owed.shape), start, np.full_like(start, velocity), 0.0, PERIOD, looks=owed)


@pytest.mark.parametrize("velocity", [0.0, 0.4])
def test_a_slow_sweep_brings_all_looks_and_keeps_every_bound(velocity):
    task = many_looks(velocity=velocity)
    best = min(timed_sweeps(task, 18, UNLIMITED), key=lambda candidate: candidate.rank)
    assert best.complete
    assert best.kind is GuessKind.TIMED_SWEEP
    plan = best.plan
    assert (look_counts(plan.position, task.cell, task.fleet.radius) >= task.looks).all()
    report = verify_motion(task.fleet, plan.time, plan.position, plan.velocity, plan.input, at_rest=True)
    assert report.holds, str(report.first_failure)
    # no disc holds more than 16 of these cells
    assert plan.steps + 1 >= task.looks.sum() / (2 * 16)


def test_looks_that_differ_from_cell_to_cell_and_agents_that_differ():
    rng = np.random.default_rng(4)
    task = many_looks(radius=np.array([[1.0], [1.4]]), speed_max=np.array([1.5, 0.7]))
    task = replace(task, looks=rng.integers(0, 12, task.looks.shape), weight=np.ones_like(task.weight))
    task = replace(task, weight=np.where(task.looks > 0, 1.0, 0.0))
    best = min(timed_sweeps(task, 18, UNLIMITED), key=lambda candidate: candidate.rank)
    assert best.complete


def test_one_plan_comes_even_when_time_is_up():
    assert timed_sweeps(many_looks(), 18, EXHAUSTED)


def test_plans_that_break_the_separation_are_mended():
    task = many_looks(looks=6)
    crossing = [at([1.6, 2.0], [3.4, 2.0]), at([0.6, 2.0], [3.4, 2.1])]
    paths = [np.concatenate([here[None], path]) for here, path in zip(task.position, crossing, strict=True)]
    dwelling = solve_dwell_times(paths, task.fleet, task.cell, task.looks.astype(float), PERIOD)
    steps = int(np.ceil(max(samples.sum() for samples in dwelling.samples))) + 1
    motion = track_samples(timed_samples(dwelling, steps), task.position, task.velocity, task.fleet, PERIOD)
    flown = [evaluate_guess(task, Guess(Origin(GuessKind.GIVEN, "crossing"), motion=motion))]
    assert not any(candidate.feasible for candidate in flown)
    best = repair_sweeps(task, flown, make_backend("piqp"), 1, UNLIMITED)[0]
    assert best.feasible
    assert best.refined.violation < min(candidate.refined.violation for candidate in flown)
    assert not repair_sweeps(task, flown, make_backend("piqp"), 1, EXHAUSTED)
