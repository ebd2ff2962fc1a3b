"""Missions of every kind, in closed loop: finished, as the verifier sees it; the same again; and by a successor."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from mission_kinds import KINDS, SEVERAL
from mission_kinds import mission_with as kinds_mission
from service_fakes import Bench, SweepLaw

from mpc_cover.control.receding_horizon import RecedingHorizon
from mpc_cover.information.build import make_map
from mpc_cover.planning.initial_guess.boustrophedon import rest_guess, tour_guess
from mpc_cover.planning.task import evaluate_guess
from mpc_cover.service.controller.checkpoint import FileCheckpoints
from mpc_cover.service.controller.state_directory import StateDirectory
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
    law, statuses = RecedingHorizon(mission), []
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
        law = RecedingHorizon(mission)
        result = simulate(mission, law=law)
        flights.append((result.trajectory.position.tobytes(), law.coverage.map.estimate.tobytes()))
    assert flights[0] == flights[1]


def test_a_patrol_goes_on_until_its_time_is_over():
    mission = mission_with(KINDS["ageing"], time_limit_s=25.0)
    law, statuses = RecedingHorizon(mission), []
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
    law = RecedingHorizon(mission)
    prepared = []

    def nothing(task, deadline):
        still = rest_guess(task.position)
        return evaluate_guess(task, still, task.flown(still, task.least_steps))

    monkeypatch.setattr(law._planner, "timed_sweeps", lambda *_, **__: [])
    monkeypatch.setattr(law._planner, "quick", nothing)
    whole = lambda task, deadline, effort_s: prepared.append(task) or one_lap(task)  # noqa: E731
    monkeypatch.setattr(law._planner, "whole", whole)
    result = simulate(mission, law=law)
    assert result.complete
    assert len(prepared) > 1
    assert any("a step is too short to plan anew" in event for event in result.events)
    assert check_trajectory(result.trajectory).holds


def one_lap(task):
    """Return a tour of what is owed, as one of the two flies it: so nobody meets."""
    tour = tour_guess(task.fleet, task.cell, task.weight, task.position)
    found = []
    for pilot in (0, 1):
        paths = [path if i == pilot else task.position[i][None] for i, path in enumerate(tour.paths)]
        guess = replace(tour, paths=paths)
        found.append(evaluate_guess(task, guess, task.flown(guess, None)))
    return min(found, key=lambda candidate: (not candidate.feasible, candidate.cost))


def test_a_lost_agent_leaves_its_looks_to_the_other():
    mission = mission_with(KINDS["looks"], time_limit_s=90.0)
    result = simulate(mission, deaths={"a2": 2.0})
    assert result.complete
    assert result.lost == ("a2",)
    assert np.isfinite(result.trajectory.covered_at).all()


@pytest.mark.parametrize("kind", ["looks", "kalman"])
def test_a_successor_counts_no_look_twice_and_misses_none(kind, tmp_path):
    """It takes up a checkpoint, and the agents' histories, which begin long before it."""
    mission = mission_with(KINDS[kind] | ({"looks": 6} if kind == "looks" else {"target_variance": 0.16}))
    bench = Bench(mission)
    for name in ("a1", "a2"):
        bench.agent(name)
    first = Sweep(mission)
    with StateDirectory(tmp_path / "state") as folder:
        checkpoints = FileCheckpoints(folder, mission, monotonic=bench.clock.now)
        controller = bench.controller(first, checkpoints=checkpoints)
        bench.run(controller, until=lambda: controller.mission_time_s > 3.3)
        bench.run(seconds=8.0)  # it died; the agents fly to the ends of their plans, and look on
        resume, text = FileCheckpoints(folder, mission).load()
        assert resume is not None, text
        second = Sweep(mission)
        successor = bench.controller(second, epoch=2, identity="second", resume=resume)
        bench.run(successor, until=lambda: successor.phase is Phase.FLYING)
    np.testing.assert_array_less(0, second.coverage.map.done_at)  # nothing was lost to a bad restore
    whole = make_map(mission)
    states = sorted((s for n in ("a1", "a2") for s in bench.states(n)), key=lambda state: state.time_s)
    takeoff = states[0].time_s + 0.5
    now = successor._clock.now()
    for state in states:
        if state.time_s <= now:
            position = np.full((2, 2), np.nan)
            position[mission.fleet.ids.index(state.agent)] = state.position
            whole.observe(max(0.0, state.time_s - takeoff), position)
    for name, array in whole.map.kept.items():
        if name != "state":  # the order of two agents' readings at one instant is another
            np.testing.assert_allclose(second.coverage.map.kept[name], array, atol=1e-6, err_msg=name)


class Sweep(SweepLaw):
    """A sweep up and down that keeps the mission's kind of map."""

    def __init__(self, mission):
        super().__init__(mission)
        self.coverage = make_map(mission)
