"""Delayed maps over-estimate (5.2.1.1), by a fixed delay and by hops; and what has been heard counts once."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from maps_fixtures import box_field, flight, seeing

from mpc_cover.information.ageing import AgeingMap
from mpc_cover.information.delay import FixedDelay, RelayDelay, adjacency, hop_counts
from mpc_cover.information.delayed_map import DelayedMaps, HeardMap
from mpc_cover.information.effective import Bump, EffectiveCoverage, k_coverage
from mpc_cover.information.kalman import KalmanMap
from mpc_cover.information.scalar_field import NoisySensing

MAPS = {
    "looks": lambda s: k_coverage(s, 4),
    "effective": lambda s: EffectiveCoverage(s, 2.0, Bump(peak=0.7, rim=0.05)),
    "kalman": lambda s: KalmanMap(s, variance=4.0, noise=1.0, enough=0.25),
    "ageing": lambda s: AgeingMap(s, fresh_s=1.0),
}
AGENTS = 4


def delays(rng):
    matrix = rng.integers(0, 6, (AGENTS, AGENTS))
    return [FixedDelay(3), FixedDelay(matrix), RelayDelay(AGENTS)][int(rng.integers(3))]


@pytest.mark.parametrize("kind", MAPS)
@settings(max_examples=30)
@given(seed=st.integers(0, 10**6))
def test_every_agents_map_over_estimates(kind, seed):
    rng = np.random.default_rng(seed)
    field = box_field(4.0, 4.0)
    sight = seeing(field, AGENTS)
    true = MAPS[kind](sight)
    own = DelayedMaps([MAPS[kind](sight) for _ in range(AGENTS)], delays(rng))
    before = None
    for n, position in enumerate(flight(rng, field, 15, AGENTS)):
        looks = sight.looks(0.5 * n, position)
        true.take(looks)
        own.observe(n, looks, adjacency(position, 2.0))
        if kind == "ageing":
            for each in (true, *own.maps):
                each.pass_time(0.5 * n)
        for each in own.maps:
            assert (each.residual >= true.residual - 1e-12).all()
            if each.complete:
                assert true.complete
        if kind != "ageing" and before is not None:
            assert all((a.residual <= b).all() for a, b in zip(own.maps, before, strict=True))
        before = [each.residual for each in own.maps]


@settings(max_examples=30)
@given(seed=st.integers(0, 10**6), delta=st.integers(0, 9))
def test_a_fixed_delay_is_the_fleets_map_of_then_with_ones_own_of_now(seed, delta):
    rng = np.random.default_rng(seed)
    field = box_field(4.0, 4.0)
    sight = seeing(field, AGENTS)
    path = flight(rng, field, 14, AGENTS)
    own = DelayedMaps([k_coverage(sight, 50) for _ in range(AGENTS)], FixedDelay(delta))
    for n, position in enumerate(path):
        own.observe(n, sight.looks(float(n), position), np.zeros((AGENTS, AGENTS), dtype=bool))
        expected = k_coverage(sight, 50)
        for sample in range(n + 1):
            known = path[sample].copy()
            if sample > n - delta:
                known[np.arange(AGENTS) != 1] = np.nan
            expected.observe(float(sample), known)
        assert (own.maps[1].residual == expected.residual).all()


def test_without_delay_everyone_has_the_fleets_map():
    rng = np.random.default_rng(5)
    field = box_field()
    truth = rng.normal(size=(1, field.size))
    sensing = NoisySensing(seeing(field), truth, 0.5, rng)
    make = lambda: KalmanMap(sensing, variance=1.0, noise=0.5, enough=0.1)  # noqa: E731
    true, own = make(), DelayedMaps([make() for _ in range(3)], FixedDelay(0))
    for n, position in enumerate(flight(rng, field)):
        looks = sensing.looks(float(n), position)
        true.take(looks)
        own.observe(n, looks, np.zeros((3, 3), dtype=bool))
    for each in own.maps:
        np.testing.assert_allclose(each.estimate, true.estimate)
        np.testing.assert_allclose(each.variance, true.variance)


@settings(max_examples=60)
@given(seed=st.integers(0, 10**6))
def test_over_a_graph_that_stays_the_delay_is_the_hops(seed):
    rng = np.random.default_rng(seed)
    agents = int(rng.integers(1, 8))
    adjacent = rng.random((agents, agents)) < 0.4
    adjacent = (adjacent | adjacent.T) & ~np.eye(agents, dtype=bool)
    hops = hop_counts(adjacent)
    relay = RelayDelay(agents)
    for n in range(12):
        known = relay.known(n, adjacent)
        assert (known == np.where(hops < agents, np.maximum(n - hops, -1), -1)).all()


def test_hops_along_a_line():
    position = np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [9.0, 0.0]])
    hops = hop_counts(adjacency(position, 1.0))
    assert hops.tolist() == [[0, 1, 2, 4], [1, 0, 1, 4], [2, 1, 0, 4], [4, 4, 4, 0]]


def test_what_was_known_stays_known_when_the_graph_falls_apart():
    relay = RelayDelay(2)
    together = ~np.eye(2, dtype=bool)
    apart = np.zeros((2, 2), dtype=bool)
    relay.known(0, together)
    assert relay.known(1, together)[0, 1] == 0
    assert relay.known(2, apart)[0, 1] == 0
    assert relay.known(3, together)[0, 1] == 2


def test_each_sample_counts_once_however_often_it_is_relayed():
    field = box_field(1.0, 1.0)
    sight = seeing(field, 2, 5.0)
    heard = HeardMap(k_coverage(sight, 10), 2)
    looks = [sight.looks(float(n), np.array([[0.5, 0.5]]), np.array([1])) for n in range(4)]
    assert heard.hear(1, 2, looks[2])
    assert heard.missing(1) == 0
    assert heard.hear(1, 0, looks[0])
    assert not heard.hear(1, 2, looks[2])
    assert not heard.hear(1, 0, looks[0])
    assert heard.missing(1) == 1
    assert heard.hear(1, 1, looks[1])
    assert heard.missing(1) == 3
    assert (heard.map.residual == 7.0).all()


def test_the_log_is_forgotten_when_everyone_has_read_it():
    field = box_field()
    sight = seeing(field)
    own = DelayedMaps([k_coverage(sight, 2) for _ in range(3)], FixedDelay(4))
    for n, position in enumerate(flight(np.random.default_rng(0), field, 40)):
        own.observe(n, sight.looks(float(n), position), np.zeros((3, 3), dtype=bool))
        assert len(own._log) <= 5


def test_a_delay_is_not_negative():
    with pytest.raises(ValueError, match="delay"):
        FixedDelay(-1)
