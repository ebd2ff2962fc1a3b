"""Missions of every kind, in closed loop: finished, as the verifier sees it, and the same again."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from mission_kinds import KINDS, SEVERAL
from mission_kinds import mission_with as kinds_mission
from sweep_laws import WatchedLaw

from mpc_cover.control.receding_horizon import RecedingHorizon
from mpc_cover.planning.candidate import evaluate_guess
from mpc_cover.planning.initial_guess.guess import rest_guess
from mpc_cover.planning.initial_guess.tour import tour_guess
from mpc_cover.planning.planner import Planner
from mpc_cover.service.protocol.messages import Phase
from mpc_cover.service.run.simulate import simulate
from mpc_cover.trajectory_file import load_trajectory, save_trajectory
from mpc_cover.verification.check import check_trajectory


def mission_with(information, **options):
    """Return a mission so small that its thorough plan takes no time."""
    return kinds_mission(information, **{"edge": 3.5, "radius": 1.2, **options})


@pytest.mark.parametrize("kind", SEVERAL)
def test_it_is_finished_and_what_was_counted_was_flown(kind, tmp_path):
    mission = mission_with(KINDS[kind], time_limit_s=60.0)
    law, statuses = WatchedLaw(RecedingHorizon(mission)), []
    result = simulate(mission, law=law, on_tick=statuses.append)
    assert result.complete
    report = check_trajectory(result.trajectory)
    assert report.holds, report.first_failure
    assert np.isfinite(result.trajectory.covered_at).all()
    np.testing.assert_allclose(law.coverage.covered_at, result.trajectory.covered_at, atol=1e-6)
    assert statuses[-1].covered_count == mission.field.size
    save_trajectory(result.trajectory, tmp_path / "t.npz")
    assert check_trajectory(load_trajectory(tmp_path / "t.npz")).holds


def test_a_kalman_flight_is_the_same_again():
    mission = mission_with(KINDS["kalman"], time_limit_s=60.0)
    flights = []
    for _ in range(2):
        law = WatchedLaw(RecedingHorizon(mission))
        result = simulate(mission, law=law)
        flights.append((result.trajectory.position.tobytes(), law.coverage.map.estimate.tobytes()))
    assert flights[0] == flights[1]


def test_a_patrol_goes_on_until_its_time_is_over():
    mission = mission_with(KINDS["ageing"], time_limit_s=25.0)
    law, statuses = WatchedLaw(RecedingHorizon(mission)), []
    result = simulate(mission, law=law, on_tick=statuses.append)
    assert result.complete
    assert statuses[-1].phase is Phase.COMPLETE
    assert "the patrol ends after control.time_limit_s 25 s" in result.events[-1]
    assert result.trajectory.time[-1] > 25.0
    assert check_trajectory(result.trajectory).holds
    laps = np.isfinite(result.trajectory.covered_at)
    assert laps.all()
    assert law.coverage.ages.worst_age < 25.0 - result.trajectory.covered_at.max()  # everything was seen again


def test_where_no_way_on_is_found_in_flight_it_is_planned_at_rest(monkeypatch):
    """Laps too long to be planned in a control step: many looks, no slow sweep, and a search in flight in vain."""
    mission = mission_with({"kind": "looks", "looks": 8}, time_limit_s=120.0)
    prepared = []

    def nothing(_planner, task, _budget):
        return evaluate_guess(task, rest_guess(task.position), task.least_steps)

    def thorough(_planner, task, _budget):
        prepared.append(task)
        return one_lap(task)

    monkeypatch.setattr(Planner, "timed_sweeps", lambda *_, **__: [])
    monkeypatch.setattr(Planner, "quick", nothing)
    monkeypatch.setattr(Planner, "thorough", thorough)
    result = simulate(mission)
    assert result.complete
    assert len(prepared) > 1
    assert any("a step is too short to plan anew" in event for event in result.events)
    assert check_trajectory(result.trajectory).holds


def one_lap(task):
    """Return a tour of all that is owed, as one of the two flies it: so nobody meets."""
    tour = tour_guess(task.fleet, task.cell, task.weight, task.position)
    found = []
    whole = np.concatenate(tour.paths)
    for pilot in (0, 1):
        paths = [whole if i == pilot else task.position[i][None] for i in (0, 1)]
        guess = replace(tour, paths=paths)
        found.append(evaluate_guess(task, guess))
    return min(found, key=lambda candidate: (not candidate.feasible, candidate.cost))


def test_a_lost_agent_leaves_its_looks_to_the_other():
    mission = mission_with(KINDS["looks"], time_limit_s=90.0)
    result = simulate(mission, deaths={"a2": 2.0})
    assert result.complete
    assert result.lost == ("a2",)
    assert np.isfinite(result.trajectory.covered_at).all()
