"""Many looks in one go: the linear programme asks for what is owed and no more, and what is flown brings it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from flights import fleet_of
from hypothesis import given, settings
from hypothesis import strategies as st
from motions import PERIOD, grid

from mpc_cover.model.sensing import look_counts
from mpc_cover.planning.initial_guess.boustrophedon import Guess
from mpc_cover.planning.initial_guess.dwell_time_lp import discretised, solve_dwell_times, timed_samples
from mpc_cover.planning.initial_guess.timed_sweeps import _flown, repair_sweeps, timed_sweeps
from mpc_cover.planning.initial_guess.waypoint_tracking import track_samples
from mpc_cover.planning.task import Task, evaluate_guess, needs_laps
from mpc_cover.verification.motion import verify_motion
from solvers.backends.registry import make_backend


def at(*points):
    return np.array(points, dtype=float)


@given(looks=st.floats(1.0, 40.0), agents=st.integers(1, 4))
def test_agents_beside_one_cell_share_its_looks_evenly(looks, agents):
    fleet = fleet_of(np.repeat(at([0.0, 0.0]), agents, axis=0))
    found = solve_dwell_times([at([0.0, 0.1])] * agents, fleet, at([0.0, 0.0]), np.array([[looks]]), PERIOD)
    times = np.array([samples.sum() for samples in found.samples])
    assert times.sum() == pytest.approx(looks, rel=1e-6)
    assert times.max() == pytest.approx(looks / agents, rel=1e-6)


def test_two_cells_far_apart_take_the_sum_of_their_looks_and_the_way_between():
    fleet = fleet_of(at([0.0, 0.0]))
    found = solve_dwell_times(
        [at([0.0, 0.0], [10.0, 0.0])], fleet, at([0.0, 0.0], [10.0, 0.0]), np.array([[4.0, 7.0]]), PERIOD
    )
    # 10 m at three quarters of 1.5 m/s are 17.8 samples, of which 0.98 m at either end count as looks too
    way, ends = 10.0 / (0.75 * 1.5 * PERIOD), 0.98 / (0.75 * 1.5 * PERIOD)
    assert found.samples[0].sum() == pytest.approx(11.0 + way - 2.0 * ends, abs=2.0 * 0.25 / (0.75 * 1.5 * PERIOD))


@settings(max_examples=15)
@given(seed=st.integers(0, 10**6))
def test_every_cell_in_reach_gets_what_it_is_owed_and_nobody_is_too_fast(seed):
    rng = np.random.default_rng(seed)
    agents = int(rng.integers(1, 4))
    fleet = fleet_of(rng.uniform(0.0, 4.0, (agents, 2)), radius=rng.uniform(0.8, 1.5, (agents, 1)))
    cell, paths = grid(8, 0.5), [rng.uniform(0.0, 4.0, (int(rng.integers(1, 5)), 2)) for _ in range(agents)]
    looks = rng.integers(0, 9, (1, cell.shape[0])).astype(float)
    found = solve_dwell_times(paths, fleet, cell, looks, PERIOD)
    got = np.zeros(cell.shape[0])
    reachable = np.zeros(cell.shape[0], dtype=bool)
    for i, (point, samples) in enumerate(zip(found.point, found.samples, strict=True)):
        seen = np.linalg.norm(cell[:, None] - point[None], axis=2) <= 0.98 * fleet.radius[i, 0]
        got += seen @ samples
        reachable |= seen.any(axis=1)
        assert (found.length[i] <= 0.75 * fleet.speed_max[i] * PERIOD * samples + 1e-9).all()
    assert (got[reachable] >= looks[0, reachable] - 1e-6).all()


@given(seed=st.integers(0, 10**6), longest=st.floats(0.1, 2.0))
def test_pieces_are_short_and_make_up_the_path(seed, longest):
    path = np.random.default_rng(seed).uniform(-3.0, 3.0, (4, 2))
    point, length = discretised(path, longest)
    assert length.sum() == pytest.approx(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())
    assert np.linalg.norm(np.diff(point, axis=0), axis=1).max() <= longest + 1e-9
    for waypoint in path:
        assert np.abs(point - waypoint).sum(axis=1).min() < 1e-9


def test_whoever_dwells_is_where_the_programme_says_for_as_long():
    fleet = fleet_of(at([0.0, 0.0]))
    found = solve_dwell_times(
        [at([0.0, 0.0], [6.0, 0.0])], fleet, at([0.0, 0.0], [6.0, 0.0]), np.array([[10.0, 10.0]]), PERIOD
    )
    where = timed_samples(found, int(np.ceil(found.samples[0].sum())))[:, 0, 0]
    assert where[0] == 0.0
    assert where[-1] == pytest.approx(6.0)
    assert (np.diff(where) >= -1e-12).all()
    assert (where <= 0.98).sum() >= 9
    assert (where >= 6.0 - 0.98).sum() >= 9


@settings(max_examples=25)
@given(seed=st.integers(0, 10**6), steps=st.integers(1, 30), wild=st.floats(0.0, 3.0))
def test_whatever_is_wanted_the_motion_keeps_the_limits_and_ends_at_rest(seed, steps, wild):
    rng = np.random.default_rng(seed)
    fleet = fleet_of(rng.uniform(-1.0, 1.0, (3, 2)))
    wanted = fleet.start + np.cumsum(rng.normal(scale=wild, size=(steps + 1, 3, 2)), axis=0)
    motion = track_samples(wanted, fleet.start, np.zeros((3, 2)), fleet, PERIOD)
    force = np.diff(motion.velocity, axis=0) / PERIOD
    assert np.linalg.norm(motion.velocity, axis=2).max() <= 1.5
    assert np.linalg.norm(force, axis=2).max() <= 1.5 + 1e-9
    assert not motion.velocity[-1].any()
    report = verify_motion(
        fleet, PERIOD * np.arange(motion.steps + 1), motion.position, motion.velocity, force, at_rest=True
    )
    assert report.holds, str(report.first_failure)


def test_what_is_wanted_slowly_is_flown_closely():
    fleet, turn = fleet_of(at([2.0, 0.0])), np.linspace(0.0, np.pi, 60)
    wanted = np.stack([2.0 * np.cos(turn), 2.0 * np.sin(turn)], axis=1)[:, None]
    motion = track_samples(wanted, fleet.start, np.zeros((1, 2)), fleet, PERIOD)
    assert np.abs(motion.position[: len(wanted)] - wanted).max() < 0.08


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
    best = min(timed_sweeps(task, 18), key=lambda candidate: candidate.rank)
    assert best.complete
    assert best.kind.startswith("slow ")
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
    best = min(timed_sweeps(task, 18), key=lambda candidate: candidate.rank)
    assert best.complete


def test_one_plan_comes_even_when_time_is_up():
    assert timed_sweeps(many_looks(), 18, deadline=0.0)


def test_few_looks_take_no_laps():
    assert not needs_laps(None)
    assert not needs_laps(np.array([[3, 0, 1]]))
    assert needs_laps(np.array([[0, 4]]))


def test_plans_that_break_the_separation_are_mended():
    task = many_looks(looks=6)
    crossing = [at([1.6, 2.0], [3.4, 2.0]), at([0.6, 2.0], [3.4, 2.1])]
    motions = list(_flown(task, Guess("crossing", crossing)))
    flown = [evaluate_guess(task, Guess("crossing", crossing), motion) for motion in motions]
    assert not any(candidate.feasible for candidate in flown)
    best = repair_sweeps(task, flown, make_backend("piqp"), 1, None)[0]
    assert best.feasible
    assert best.refined.violation < min(candidate.refined.violation for candidate in flown)
    assert not repair_sweeps(task, flown, make_backend("piqp"), 1, deadline=0.0)
