"""Claims of every kind of information: the map's and the verifier's own count agree, and lies are seen."""

from __future__ import annotations

import io
from dataclasses import replace

import numpy as np
import pytest
from flights import leg, propagate
from mission_kinds import KINDS, SEVERAL, mission_with
from rich.console import Console

from mpc_cover.information.replay import measured_at
from mpc_cover.trajectory_file import Recording
from mpc_cover.verification.check import check_trajectory
from mpc_cover.verification.coverage_claim import first_measured
from mpc_cover.verification.summary import summarise
from mpc_cover.view.tables import print_report


def flight_of(information, **options):
    """Return both agents flying up, across and back, sampled five times a period."""
    mission = mission_with(information, **options)
    up, right, down = np.tile([0.0, 2.0], (2, 1)), np.tile([1.3, 0.0], (2, 1)), np.tile([0.0, -2.0], (2, 1))
    force = np.concatenate([leg(move, 0.1, 12, 14) for move in (up, right, down)])
    time = 0.1 * np.arange(len(force) + 1)
    position, velocity = propagate(mission.fleet.start, force, time)
    claim = measured_at(mission, time, position)
    return Recording(
        *(time, position, velocity, force),
        cell=mission.field.cell,
        covered_at=claim,
        agent_id=mission.fleet.ids,
        mission=mission,
        meta={"kind": "simulate"},
    )


def failed(trajectory):
    return {check.name for check in check_trajectory(trajectory).failures}


@pytest.mark.parametrize("kind", KINDS)
def test_what_the_map_says_holds(kind):
    trajectory = flight_of(KINDS[kind])
    assert failed(trajectory) == set()
    settled = np.isfinite(trajectory.covered_at)
    assert 0.3 < settled.mean() < 1.0
    again = first_measured(trajectory, trajectory.mission.fleet.radius + 1e-9)
    np.testing.assert_allclose(again, trajectory.covered_at)


@pytest.mark.parametrize("kind", KINDS)
def test_claims_that_are_too_early_too_late_or_missing_are_seen(kind):
    honest = flight_of(KINDS[kind])
    k = int(np.flatnonzero(np.isfinite(honest.covered_at) & (honest.covered_at > 1.0))[0])
    for change, name in ((-0.1, "coverage claimed"), (0.1, "coverage kept"), (np.inf, "coverage kept")):
        claim = honest.covered_at.copy()
        claim[k] += change
        assert failed(replace(honest, covered_at=claim)) == {name}
    claim = np.where(np.isfinite(honest.covered_at), honest.covered_at, 5.0)
    assert failed(replace(honest, covered_at=claim)) == {"coverage claimed"}


@pytest.mark.parametrize("kind", SEVERAL)
def test_one_look_is_not_enough(kind):
    several, one = flight_of(KINDS[kind]), flight_of(None)
    assert (several.covered_at >= one.covered_at).all()
    assert failed(replace(several, covered_at=one.covered_at)) == {"coverage claimed"}


def test_plain_summaries_say_nothing_of_information():
    trajectory = flight_of(None)
    summary = summarise(trajectory, check_trajectory(trajectory))
    assert "information" not in summary.to_dict()


def test_ages_are_those_of_each_cell_on_its_own():
    trajectory = flight_of(KINDS["ageing"], radius=2.5)
    assert np.isfinite(trajectory.covered_at).all()
    distance = np.linalg.norm(trajectory.position[:, :, None] - trajectory.cell, axis=3)
    seen = (distance <= 2.5).any(axis=1)
    ages = np.zeros(seen.shape)
    for k in range(seen.shape[1]):
        last = 0.0
        for n, time in enumerate(trajectory.time):
            last = time if seen[n, k] else last
            ages[n, k] = time - last
    found = summarise(trajectory, check_trajectory(trajectory)).information
    assert found["worst_age_s"] == pytest.approx(ages.max())
    assert found["mean_age_s"] == pytest.approx(ages.mean(), rel=0.02)
    known = trajectory.time >= trajectory.covered_at.max()
    assert found["worst_age_after_first_lap_s"] == pytest.approx(ages[known].max())


def aged(limit_s, **more):
    """Return a patrol's flight, and the greatest age of a look on it, cell by cell and look by look."""
    trajectory = flight_of({"kind": "ageing", "age_limit_s": limit_s, **more}, radius=2.5)
    distance = np.linalg.norm(trajectory.position[:, :, None] - trajectory.cell, axis=3)
    worst = 0.0
    for k in range(len(trajectory.cell)):
        looks = trajectory.time[(distance[:, :, k] <= 2.5).any(axis=1)]
        worst = max(worst, np.diff([0.0, *looks, trajectory.time[-1]]).max())
    return trajectory, worst


def test_ages_are_a_figure_unless_the_mission_is_strict_about_their_limit():
    trajectory, worst = aged(1.0)
    assert 1.5 < worst < trajectory.time[-1]
    report = check_trajectory(trajectory)
    assert report.holds
    assert "age limit" not in {check.name for check in report.checks}
    console = Console(file=(shown := io.StringIO()), width=200)
    print_report(report, console, summarise(trajectory, report).information)
    assert "age limit 1 s" in shown.getvalue()


def test_a_strict_patrol_is_held_to_its_limit():
    _, worst = aged(1.0)
    for limit_s, holds in ((worst + 0.01, True), (worst - 0.01, False)):
        check = next(c for c in check_trajectory(aged(limit_s, strict=True)[0]).checks if c.name == "age limit")
        assert check.holds == holds
        assert check.margin == pytest.approx(limit_s - worst)
        assert f"no look for {worst:.2f} s until t = " in check.where


def test_variances_and_looks_are_those_of_the_map():
    found = {}
    for kind in SEVERAL:
        trajectory = flight_of(KINDS[kind])
        found[kind] = summarise(trajectory, check_trajectory(trajectory)).information
        assert found[kind]["kind"] == kind
    assert found["kalman"]["largest_variance"] == pytest.approx(4.0)  # somewhere nobody looked
    assert found["kalman"]["mean_variance"] < 2.5
    assert found["looks"]["largest_gamma"] == 2.0
    assert found["effective"]["largest_gamma"] == pytest.approx(1.5)
