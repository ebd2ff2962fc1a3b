"""The linear programme asks for the looks that are owed and no more."""

from __future__ import annotations

import numpy as np
import pytest
from flights import fleet_of
from hypothesis import given, settings
from hypothesis import strategies as st
from motions import PERIOD, grid

from mpc_cover.planning.initial_guess.dwell_time_lp import discretised, solve_dwell_times, timed_samples


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
