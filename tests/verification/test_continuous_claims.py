"""Continuous sensing: the verifier finds for itself what the path passed, and what a bound can promise."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from flights import propagate
from hypothesis import given
from hypothesis import strategies as st

from mpc_cover.information.replay import measured_at
from mpc_cover.mission.load import build_mission, load_mission
from mpc_cover.trajectory_file import Recording
from mpc_cover.verification.area_bound import swath_bound
from mpc_cover.verification.coverage_claim import check_coverage, parabola_distance
from mpc_cover.verification.summary import look_interval


def mission_of(**changes):
    raw = json.loads(load_mission("box-3").to_json())
    raw["fleet"]["defaults"] |= {"speed_max_m_per_s": 4.0, "input_max_m_per_s2": 4.0}
    control = raw["control"] | changes.pop("control", {})
    return build_mission(raw | {"control": control} | changes, "test")


def flight(mission, seed, steps=6, period=1.0):
    force = np.random.default_rng(seed).uniform(-2.0, 2.0, (steps, 3, 2))
    time = period * np.arange(steps + 1)
    position, velocity = propagate(mission.fleet.start, force, time)
    covered = measured_at(mission, time, position, velocity)
    meta = {"kind": "plan", "version": "0", "seed": 0, "backend": "none"}
    arrays = {"time": time, "position": position, "velocity": velocity, "input": force}
    cells = {"cell": mission.field.cell, "covered_at": covered, "agent_id": mission.fleet.ids}
    return Recording(**arrays, **cells, mission=mission, meta=meta)


@given(seed=st.integers(0, 10**6), bent=st.booleans(), dimension=st.sampled_from([2, 3]))
def test_the_distance_to_a_parabola_is_the_least_of_a_dense_sample(seed, bent, dimension):
    rng = np.random.default_rng(seed)
    a, b, c = rng.normal(size=(5, dimension)), 3.0 * rng.normal(size=dimension), bent * 3.0 * rng.normal(size=dimension)
    part = np.linspace(0.0, 1.0, 2001)[:, None, None]
    sampled = np.linalg.norm(a + part * b + part**2 * c, axis=2).min(axis=0)
    exact = parabola_distance(a, b, c)
    assert (exact <= sampled + 1e-12).all()
    np.testing.assert_allclose(exact, sampled, atol=1e-2)


@given(seed=st.integers(0, 10**6))
def test_it_agrees_with_what_is_claimed_and_turns_down_more_and_less(seed):
    good = flight(mission_of(sensing="continuous"), seed)
    assert all(check.holds for check in check_coverage(good))
    seen = np.flatnonzero(np.isfinite(good.covered_at) & (good.covered_at > 0.0))
    never = np.flatnonzero(np.isinf(good.covered_at))
    for cell, claim in ((seen[0], good.covered_at[seen[0]] - 1.0), (seen[-1], np.inf), (never[0], 2.0)):
        lie = good.covered_at.copy()
        lie[cell] = claim
        assert not all(check.holds for check in check_coverage(replace(good, covered_at=lie)))


def test_a_pass_between_samples_is_no_look_of_a_sampled_sensor():
    claimed = flight(mission_of(sensing="continuous"), 1)
    assert not all(check.holds for check in check_coverage(replace(claimed, mission=mission_of(sensing="sampled"))))


def test_no_bound_assumes_more_than_a_disc_a_look():
    slow = mission_of(control={"period_s": 2.0})
    swath = swath_bound(slow)
    assert swath == pytest.approx((100.0 - 3.0 * np.pi) / (3 * 2.0 * 4.0))
    plan = flight(slow, 1)
    assert look_interval(plan) == 2.0
    assert swath_bound(slow, 2.0) == pytest.approx(2.0 * (100.0 / (3.0 * np.pi) - 1.0))
    flown = replace(plan, meta=plan.meta | {"kind": "simulate"})
    assert swath_bound(slow, look_interval(flown)) == swath, "agents look every 0.1 s"
    assert look_interval(replace(plan, mission=mission_of(sensing="continuous"))) == 0.0
