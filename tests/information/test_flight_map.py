"""Maps in flight count what a person with a list would count, promise what plans promise, and survive their owner."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from maps_fixtures import flight
from mission_kinds import KINDS, SEVERAL, mission_with

from mpc_cover.information.build import make_map, true_field
from mpc_cover.information.coverage_map import CoverageMap
from mpc_cover.model.sensing import look_counts

SEEDS = st.integers(0, 10**6)


def flown(rng, mission, steps=24, state_period=0.1):
    """Return times and positions of a random flight that is reported five times a period."""
    return state_period * np.arange(steps), flight(rng, mission.field, steps, mission.fleet.size, 0.15)


def listed(mission, times, positions):
    """Return for each (magnitude, cell) all looks that count, as (time, distance), from a list for each agent."""
    fleet, period = mission.fleet, mission.spec.control.period_s
    looks = {(j, k): [] for j in range(fleet.radius.shape[1]) for k in range(mission.field.size)}
    for (j, k), found in looks.items():
        for i in range(fleet.size):
            last = None
            for time, position in zip(times, positions, strict=True):
                distance = float(np.linalg.norm(position[i] - mission.field.cell[k]))
                in_range = distance <= fleet.radius[i, j] + 1e-9
                if in_range and (last is None or time - last >= period - 1e-6 * period):
                    found.append((time, distance))
                    last = time
    return looks


@settings(max_examples=8)
@given(seed=SEEDS)
def test_looks_are_counted_as_by_hand(seed):
    rng = np.random.default_rng(seed)
    mission = mission_with({"kind": "looks", "looks": 3}, radius=1.2)
    times, positions = flown(rng, mission)
    seen = make_map(mission)
    for time, position in zip(times, positions, strict=True):
        seen.observe(time, position)
    for (j, k), looks in listed(mission, times, positions).items():
        assert seen.map.effective[j, k] == len(looks)
        done = sorted(time for time, _ in looks)[2] if len(looks) >= 3 else np.inf
        assert seen.covered_at[k] == done
        assert seen.owed[j, k] == (len(looks) < 3)


@settings(max_examples=8)
@given(seed=SEEDS)
def test_the_variance_is_that_of_so_many_readings(seed):
    rng = np.random.default_rng(seed)
    mission = mission_with(KINDS["kalman"], radius=1.2)
    times, positions = flown(rng, mission)
    seen = make_map(mission)
    for time, position in zip(times, positions, strict=True):
        seen.observe(time, position)
    for (j, k), looks in listed(mission, times, positions).items():
        variance = 1.0 / (1.0 / 4.0 + len(looks) / 1.0)
        assert seen.map.variance[j, k] == pytest.approx(variance)
        assert seen.owed[j, k] == (variance > 0.4)
        if seen.owed[j, k]:  # the fewest readings that bring it down
            needed = seen.map.looks_owed[j, k]
            assert 1.0 / (1.0 / variance + needed) <= 0.4 * (1.0 + 1e-9)
            assert 1.0 / (1.0 / variance + needed - 1) > 0.4


@settings(max_examples=20)
@given(seed=SEEDS, late=st.integers(0, 4))
def test_plans_promise_no_more_looks_than_count(seed, late):
    """A plan looks at its samples, a period apart; whatever was looked at shortly before its first one."""
    rng = np.random.default_rng(seed)
    mission = mission_with({"kind": "looks", "looks": 9}, radius=1.2)
    before, now = 0.1 * late, 0.4
    times, positions = flown(rng, mission)
    seen = make_map(mission)
    seen.observe(before, positions[0])
    asked = seen.demand(now, positions[4]).looks
    for time, position in zip(times[4:], positions[4:], strict=True):
        seen.observe(time, position)
    planned = look_counts(positions[4::5], mission.field.cell, mission.fleet.radius)
    owed_now = np.where(seen.owed, 9 - seen.map.effective, 0)
    assert (owed_now <= np.maximum(asked - planned, 0)).all()


def test_a_look_at_the_first_sample_that_comes_too_soon_is_asked_for_again():
    mission = mission_with({"kind": "looks", "looks": 3}, radius=1.2)
    seen, there = make_map(mission), mission.fleet.start
    seen.observe(0.0, there)
    at_once, later = seen.demand(0.0, there).looks, seen.demand(0.5, there).looks
    near = look_counts(there[None], mission.field.cell, mission.fleet.radius)
    assert near.max() >= 1
    np.testing.assert_array_equal(at_once, 3)
    np.testing.assert_array_equal(later, 3 - near)


@pytest.mark.parametrize("kind", KINDS)
@settings(max_examples=6)
@given(seed=SEEDS)
def test_a_successor_goes_on_as_if_nothing_had_happened(kind, seed):
    rng = np.random.default_rng(seed)
    mission = mission_with(KINDS[kind], radius=1.2)
    times, positions = flown(rng, mission)
    whole, first, second = (make_map(mission) for _ in range(3))
    for n, (time, position) in enumerate(zip(times, positions, strict=True)):
        whole.observe(time, position)
        (first if n < 13 else second).observe(time, position)
        if n == 12:
            second.restore(first.state())
    assert second.state().keys() == whole.state().keys()
    for name, array in whole.state().items():
        np.testing.assert_array_equal(second.state()[name], array, err_msg=name)
    np.testing.assert_array_equal(second.covered_at, whole.covered_at)
    assert second.fraction == whole.fraction


@pytest.mark.parametrize("kind", KINDS)
def test_the_state_of_another_map_is_refused(kind):
    mission = mission_with(KINDS[kind])
    for other in KINDS:
        if other == kind:
            continue
        strange = make_map(mission_with(KINDS[other])).state()
        mine = make_map(mission).state()
        if strange.keys() != mine.keys():
            with pytest.raises(ValueError, match="kept map"):
                make_map(mission).restore(strange)
    larger = make_map(mission_with(KINDS[kind], edge=5.0)).state()
    with pytest.raises(ValueError, match="shape"):
        make_map(mission).restore(larger)


@pytest.mark.parametrize("kind", SEVERAL)
def test_with_noise_nothing_counts_that_is_not_truly_in_range(kind):
    rng = np.random.default_rng(5)
    mission = mission_with(KINDS[kind], radius=1.2, noise=0.2)
    cautious, true = make_map(mission), make_map(mission, margin_m=0.0)
    times, positions = flown(rng, mission, steps=60)
    for time, position in zip(times, positions, strict=True):
        off = rng.normal(size=position.shape)
        off *= 0.2 * rng.uniform() / np.linalg.norm(off, axis=1, keepdims=True)
        cautious.observe(time, position + off)
        true.observe(time, position)
    assert cautious.settled.any()
    if kind == "effective":
        assert cautious.map.effective.sum() < true.map.effective.sum()
    else:
        assert (true.covered_at <= cautious.covered_at).all()


def test_plain_missions_keep_their_plain_map():
    for spec in (None, {"kind": "coverage"}, {"kind": "looks", "looks": 1}):
        assert isinstance(make_map(mission_with(spec)), CoverageMap)
    assert make_map(mission_with(None, looks=2)).map.level == 2.0


def test_the_estimate_comes_near_the_field():
    mission = mission_with({**KINDS["kalman"], "noise_variance": 0.01, "target_variance": 1e-3}, radius=9.0)
    seen = make_map(mission)
    for n in range(40):
        seen.observe(0.5 * n, mission.fleet.start)
    off = seen.map.estimate - true_field(mission)
    assert seen.complete
    assert np.abs(true_field(mission)).max() > 0.5
    assert float(np.sqrt((off**2).mean())) == pytest.approx(np.sqrt(seen.map.variance.mean()), rel=0.2)
