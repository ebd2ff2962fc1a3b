"""One run, flown and measured."""

import math
from dataclasses import replace

import msgspec
import numpy as np
import pytest
from flights import box3_flight
from study_fixtures import tiny, tiny_run

from mpc_cover.coverage.objective import coverage_cost
from mpc_cover.errors import UserError
from mpc_cover.mission.load import load_mission
from mpc_cover.service.run.simulate import simulate
from mpc_cover.studies import measure
from mpc_cover.studies.controllers import run_flight
from mpc_cover.studies.measure import cost_left, coverage_curve, fly
from mpc_cover.studies.record import LEVELS, Record, row_of, versions
from mpc_cover.verification.check import check_trajectory
from mpc_cover.verification.summary import summarise


@pytest.fixture(scope="module")
def record():
    return fly(tiny_run())


def test_the_record_says_what_the_simulation_did(record):
    mission = tiny_run().build()
    result = simulate(mission, seed=0)
    summary = summarise(result.trajectory, check_trajectory(result.trajectory))
    assert record.complete == result.complete
    assert record.covered_percent == summary.covered_percent
    assert record.time_to_99_s == summary.time_to_99_s
    assert record.ratio_99 == summary.ratio_to_bound
    assert record.distance_m == summary.distance_total_m
    assert record.violations == len(summary.violations)
    assert record.separation_margin_m == pytest.approx(summary.smallest_separation_m - 0.4)
    energy = sum(
        step * float((force**2).sum())
        for step, force in zip(np.diff(result.trajectory.time), result.trajectory.input, strict=True)
    )
    assert record.effort_m2_per_s3 == pytest.approx(energy)


def test_the_record_knows_the_steps_and_the_versions(record):
    assert record.steps == len(record.step_ms) > 0
    assert record.step_max_ms == pytest.approx(max(record.step_ms), abs=1e-3)
    assert record.step_p50_ms <= record.step_p99_ms <= record.step_max_ms
    assert record.prepare_s > 0.0
    assert record.wall_s > 0.0
    assert record.versions == versions()
    assert all(record.versions.values())
    assert not record.error


def test_a_record_survives_its_file(record):
    assert msgspec.json.decode(msgspec.json.encode(record), type=Record) == record
    row = row_of(record)
    assert row["version_mpc_cover"] == versions()["mpc_cover"]
    assert "curve_s" not in row


def test_the_curve_meets_the_times_of_the_summary(record):
    for level, time in ((90, record.time_to_90_s), (99, record.time_to_99_s), (100, record.time_to_100_s)):
        assert record.curve_s[LEVELS.index(level)] == pytest.approx(time)
    assert record.curve_s[0] == 0.0


def test_a_curve_ends_where_nothing_more_is_covered():
    curve = coverage_curve(np.array([3.0, 1.0, np.inf, 2.0]))
    times = dict(zip(LEVELS, curve, strict=True))
    assert (times[0.0], times[25.0], times[50.0], times[50.5], times[75.0]) == (0.0, 1.0, 2.0, 3.0, 3.0)
    assert times[75.5] is None
    assert times[100.0] is None


def test_the_cost_left_is_that_of_the_whole_field():
    flight, mission = box3_flight(), load_mission("box-3")
    assert np.isinf(flight.covered_at).sum() > 0
    weight = mission.field.weight[None]
    whole = coverage_cost(flight.position, mission.field.cell, mission.fleet.radius, weight)
    assert cost_left(flight) == pytest.approx(whole)
    assert cost_left(flight) > 0.0


def test_misses_and_lower_rungs_are_counted(record, monkeypatch):
    def slow(mission, controller, **given):
        flight = run_flight(mission, controller, **given)
        taken, sources = flight.step_s.copy(), list(flight.plan_sources)
        taken[:2], sources[:2] = (0.7, 0.5), ("SHIFTED", "BRAKE")
        return replace(flight, step_s=taken, plan_sources=tuple(sources))

    monkeypatch.setattr(measure, "run_flight", slow)
    found = fly(tiny_run())
    assert (found.misses, found.shifted, found.braked) == (1, 1, 1)
    assert found.steps == record.steps


def test_a_run_that_breaks_off_is_a_record_as_well(monkeypatch):
    def broken(*_, **__):
        raise UserError("no motion\nwas recorded")

    monkeypatch.setattr(measure, "run_flight", broken)
    record = fly(tiny_run(seed=4))
    assert record.error == "UserError: no motion was recorded"
    assert not record.complete
    assert record.seed == 4
    assert record.key == tiny_run(seed=4).key
    assert record.violations is None


def test_a_mission_that_runs_out_of_time_is_measured_as_far_as_it_got():
    mission = tiny(control={"time_limit_s": 1.0})
    record = fly(tiny_run("sweep", mission=mission))
    assert not record.complete
    assert not record.error
    assert record.time_to_100_s is None
    assert record.ratio_99 is None
    assert record.cost_left_m > 0.0
    assert math.isfinite(record.distance_m)
