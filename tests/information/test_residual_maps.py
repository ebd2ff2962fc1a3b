"""The properties of 5.2.1 (with its erratum), for every way to measure; and each way's own arithmetic."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from maps_fixtures import box_field, flight, seeing

from mpc_cover.information.coverage_map import CoverageMap
from mpc_cover.information.effective import Bump, EachLook, EffectiveCoverage, k_coverage
from mpc_cover.information.kalman import KalmanMap
from mpc_cover.information.visibility import Visibility
from mpc_cover.mission.load import load_mission

MAPS = {
    "plain": lambda s: k_coverage(s, 1),
    "looks": lambda s: k_coverage(s, 15),
    "effective": lambda s: EffectiveCoverage(s, 2.0, Bump(peak=0.7, rim=0.05)),
    "kalman": lambda s: KalmanMap(s, variance=4.0, noise=np.array([0.5, 1.0, 2.0]), enough=0.25),
}
MOST_LOOKS = {"plain": 1, "looks": 15, "effective": 40, "kalman": 8}
every_map = pytest.mark.parametrize("kind", MAPS)


@every_map
@settings(max_examples=25)
@given(seed=st.integers(0, 10**6))
def test_gamma_is_positive_never_grows_and_falls_where_measured(kind, seed):
    rng = np.random.default_rng(seed)
    field = box_field()
    information = MAPS[kind](seeing(field))
    before = information.residual
    for n, position in enumerate(flight(rng, field)):
        information.observe(0.5 * n, position)
        after = information.residual
        seen = np.zeros(before.shape, dtype=bool)
        seen.reshape(-1)[seeing(field).looks(0.0, position).place] = True
        assert (after >= 0.0).all()
        assert (after <= before).all()
        assert (after[seen & (before > 0)] < before[seen & (before > 0)]).all()
        assert (after[~seen] == before[~seen]).all()
        assert ((after > 0) == information.owed).all()
        assert ((information.looks_owed > 0) == information.owed).all()
        assert information.complete == (information.fraction == 1.0) == (information.covered_count == field.size)
        before = after


@every_map
def test_gamma_is_zero_after_a_finite_number_of_looks(kind):
    field = box_field(2.0, 2.0)
    information = MAPS[kind](seeing(field, 3, 5.0))
    position = np.array([[1.0, 1.0], [np.nan, np.nan], [np.nan, np.nan]])
    least = int(information.looks_owed.max())
    for n in range(MOST_LOOKS[kind]):
        assert not information.complete or n >= least
        information.observe(float(n), position)
    assert information.complete
    assert (information.residual == 0.0).all()
    assert (information.covered_at <= MOST_LOOKS[kind] - 1).all()
    assert np.isfinite(information.done_at).all()


@every_map
@settings(max_examples=25)
@given(seed=st.integers(0, 10**6))
def test_looks_may_come_in_any_order_and_grouping(kind, seed):
    rng = np.random.default_rng(seed)
    field = box_field()
    sight = seeing(field)
    path = flight(rng, field)
    forward, backward = MAPS[kind](sight), MAPS[kind](sight)
    for n, position in enumerate(path):
        forward.observe(float(n), position)
    for n in rng.permutation(len(path)):
        looks = sight.looks(float(n), path[n])
        half = rng.random(looks.count) < 0.5
        backward.take(looks.where(half))
        backward.take(looks.where(~half))
    np.testing.assert_allclose(forward.residual, backward.residual, atol=1e-12)
    assert (forward.owed == backward.owed).all()


def test_one_look_is_plain_coverage():
    mission = load_mission("box-3")
    rng = np.random.default_rng(3)
    plain = CoverageMap(mission)
    looks = k_coverage(Visibility(mission.field, mission.fleet.radius), 1)
    for n in range(20):
        position = rng.uniform(0, 10, (3, 2))
        plain.observe(0.5 * n, position)
        looks.observe(0.5 * n, position)
        assert (plain.owed == looks.owed).all()
        assert (plain.covered_at == looks.covered_at).all()
        assert plain.covered_count == looks.covered_count
        assert plain.fraction == looks.fraction


def test_k_coverage_counts_every_agents_look():
    field = box_field(1.0, 1.0)
    information = k_coverage(seeing(field, 3, 5.0), 5)
    information.observe(0.0, np.full((3, 2), 0.5))
    assert (information.residual == 2.0).all()
    assert (information.looks_owed == 2).all()
    information.observe(1.0, np.full((3, 2), 0.5))
    assert information.complete
    assert (information.covered_at == 1.0).all()


def test_magnitudes_are_settled_one_by_one():
    field = box_field(1.0, 1.0)
    information = k_coverage(Visibility(field, np.array([[2.0, -np.inf], [-np.inf, 2.0]])), 1)
    information.observe(0.0, np.array([[0.5, 0.5], [np.nan, np.nan]]))
    assert (~information.owed[0]).all()
    assert information.owed[1].all()
    assert information.fraction == 0.0
    information.observe(3.0, np.full((2, 2), 0.5))
    assert (information.covered_at == 3.0).all()


def test_tenths_add_up_to_one():
    field = box_field(0.5, 0.5)
    information = EffectiveCoverage(seeing(field, 1, 1.0), 1.0, Bump(peak=0.1, rim=0.1))
    for n in range(10):
        assert not information.complete
        information.observe(float(n), np.array([[0.25, 0.25]]))
    assert information.complete


def test_the_bump_is_largest_at_the_agent_and_positive_at_the_rim():
    field = box_field(4.0, 0.5)
    looks = seeing(field, 1, 1.0).looks(0.0, field.cell[2][None])
    amount = Bump(peak=2.0, rim=0.1)(looks)
    assert amount[looks.distance == 0.0] == 2.0
    assert amount[np.isclose(looks.distance, 1.0)] == pytest.approx(0.1)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda s: k_coverage(s, 0), "at least 1"),
        (lambda s: EffectiveCoverage(s, np.nan, EachLook()), "level"),
        (lambda s: Bump(peak=1.0, rim=0.0), "rim"),
        (lambda s: Bump(peak=0.5, rim=1.0), "rim"),
        (lambda s: KalmanMap(s, variance=0.0, noise=1.0, enough=1.0), "variance"),
        (lambda s: KalmanMap(s, variance=1.0, noise=np.array([1.0, np.nan]), enough=1.0), "noise"),
        (lambda s: KalmanMap(s, variance=1.0, noise=1.0, enough=-1.0), "enough"),
    ],
)
def test_numbers_that_make_no_sense_are_refused(make, words):
    with pytest.raises(ValueError, match=words):
        make(seeing(box_field()))


def test_a_coverage_function_must_be_positive_in_range():
    def nothing(looks):
        return np.zeros(looks.count)

    nothing.peak = 1.0
    information = EffectiveCoverage(seeing(box_field()), 1.0, nothing)
    with pytest.raises(ValueError, match="in range"):
        information.observe(0.0, np.ones((3, 2)))
