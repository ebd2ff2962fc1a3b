"""What is owed goes down by measurements only, and 100 % means all."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from mission_kinds import mission_with

from mpc_cover.information.coverage_map import CoverageMap
from mpc_cover.mission.load import load_mission


def test_nothing_is_covered_before_anyone_measures():
    coverage = CoverageMap(load_mission("box-3"))
    assert coverage.fraction == 0.0
    assert coverage.owed.all()
    assert not coverage.complete


@given(seed=st.integers(0, 10**6))
def test_the_residual_information_never_grows_and_the_first_time_counts(seed):
    """Assumption 1 of section 5.2.1, with its erratum: gamma is not increasing."""
    rng = np.random.default_rng(seed)
    coverage = CoverageMap(load_mission("box-3"))
    before = coverage.owed
    for time in rng.permutation(6) * 0.5:
        coverage.observe(float(time), rng.uniform(0, 10, (3, 2)))
        assert (coverage.owed <= before).all()
        before = coverage.owed
    assert coverage.covered_count == np.isfinite(coverage.covered_at).sum()


def test_one_cell_short_is_not_complete():
    coverage = CoverageMap(load_mission("box-3"))
    coverage.first[:, 1:] = 1.0
    assert coverage.fraction < 1.0
    assert not coverage.complete
    coverage.first[:, 0] = 2.0
    assert coverage.fraction == 1.0
    assert coverage.complete


def test_a_position_that_is_not_a_number_measures_nothing():
    coverage = CoverageMap(load_mission("box-3"))
    coverage.observe(0.0, np.full((3, 2), np.nan))
    assert coverage.fraction == 0.0


def test_the_margin_of_the_map_is_the_noise_unless_it_is_given():
    mission = mission_with(None, radius=0.9, noise=0.2)
    marked = []
    for coverage in (CoverageMap(mission), CoverageMap(mission, margin_m=0.0)):
        coverage.observe(0.0, mission.fleet.start)
        marked.append(coverage.covered_count)
    assert marked[0] < marked[1]
