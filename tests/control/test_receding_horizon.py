"""The controller in closed loop, and its ladder when the planner fails."""

from __future__ import annotations

import time

import numpy as np
import pytest

from mpc_cover.control.fallback_policy import PlanSource
from mpc_cover.control.receding_horizon import RecedingHorizon
from mpc_cover.errors import InvalidInputError, UserError
from mpc_cover.mission.load import build_mission
from mpc_cover.model.tube import tube_of
from mpc_cover.planning.initial_guess.boustrophedon import rest_guess
from mpc_cover.planning.scp import SCPResult
from mpc_cover.planning.task import Candidate, evaluate_guess
from mpc_cover.verification.motion import verify_motion

PERIOD = 0.5


def small_mission(horizon=8, **fleet):
    raw = {
        "schema": 1,
        "name": "small",
        "area": {"shape": {"kind": "box", "min_m": [0, 0], "max_m": [5, 5]}, "cell_size_m": 0.5},
        "fleet": {
            "defaults": {"sensing_radius_m": 1.0, "input_max_m_per_s2": 1.5, "speed_max_m_per_s": 1.5},
            "agents": [{"id": "a1", "start_m": [0.6, 0.6]}, {"id": "a2", "start_m": [1.6, 0.6]}],
            "separation_min_m": 0.5,
            "communication_range_m": 3.0,
            **fleet,
        },
        "control": {"period_s": PERIOD, "horizon_steps": horizon},
    }
    return build_mission(raw, "small")


def holds(mission, plan, start):
    report = verify_motion(
        mission.fleet, plan.time, plan.position, plan.velocity, plan.input, at_rest=True, start=start
    )
    return report.holds


def fly(mission, law, limit=60, disturb=None):
    """Fly the closed loop with exact agents; return the flown motion and the results of all steps."""
    position, velocity = mission.fleet.start, np.zeros_like(mission.fleet.start)
    law.coverage.observe(0.0, position)
    result = law.prepare(position, velocity, 0.0, deadline=None)
    flown, results = [(position, velocity)], [result]
    for k in range(limit):
        assert holds(mission, result.plan, (position, velocity))
        for part in (0.2, 0.4, 0.6, 0.8, 1.0):
            law.coverage.observe((k + part) * PERIOD, result.plan.at((k + part) * PERIOD)[0])
        position, velocity = result.plan.position[1], result.plan.velocity[1]
        if disturb is not None:
            position = position + disturb(k)
        flown.append((position, velocity))
        if law.coverage.complete and np.abs(velocity).max() < 1e-9:
            break
        result = law.step(position, velocity, (k + 1) * PERIOD, deadline=None)
        results.append(result)
    return flown, results


@pytest.mark.parametrize("horizon", [4, 8, 30])
def test_the_closed_loop_finishes_whatever_the_horizon(horizon):
    mission = small_mission(horizon)
    law = RecedingHorizon(mission)
    flown, results = fly(mission, law)
    assert law.coverage.complete
    assert {r.plan_source for r in results} <= {PlanSource.NEW, PlanSource.SHIFTED, PlanSource.REST}
    assert sum(r.plan_source is PlanSource.SHIFTED for r in results) < 0.2 * len(results)
    assert len(flown) * PERIOD < 12.0
    assert all(r.plan.steps >= horizon for r in results)


@pytest.mark.parametrize("backend", ["osqp", "clarabel"])
def test_every_back_end_flies_it(backend):
    mission = small_mission()
    law = RecedingHorizon(mission, backend=backend)
    fly(mission, law)
    assert law.coverage.complete


def test_small_disturbances_are_flown_out():
    mission = small_mission()
    law, rng = RecedingHorizon(mission), np.random.default_rng(3)
    fly(mission, law, disturb=lambda _: rng.normal(scale=0.002, size=(2, 2)))
    assert law.coverage.complete


def test_two_runs_are_the_same():
    runs = [fly(small_mission(), RecedingHorizon(small_mission()))[0] for _ in range(2)]
    assert np.array(runs[0]).tobytes() == np.array(runs[1]).tobytes()


def test_a_lost_agent_becomes_an_obstacle_and_the_other_finishes():
    mission = small_mission()
    law, plan = start_flying(mission)
    lost = np.array([True, False])
    resting = plan.position[4, 0]
    position = plan.position[4].copy()
    velocity = plan.velocity[4] * [[0.0], [1.0]]
    for k in range(5):
        law.coverage.observe(k * PERIOD, plan.position[k])
    law.set_lost(lost)
    fleet = law._mission.fleet
    for k in range(4, 120):
        result = law.step(position, velocity, k * PERIOD, deadline=None)
        report = verify_motion(
            fleet, result.plan.time, result.plan.position, result.plan.velocity, result.plan.input, at_rest=True
        )
        assert report.holds, report.first_failure
        assert np.abs(result.plan.position[:, 0] - resting).max() == 0.0
        assert np.linalg.norm(result.plan.position[:, 1] - resting, axis=1).min() >= 0.5
        for part in (0.5, 1.0):
            seen = result.plan.at((k + part) * PERIOD)[0].copy()
            seen[0] = np.nan
            law.coverage.observe((k + part) * PERIOD, seen)
        position, velocity = result.plan.position[1], result.plan.velocity[1]
        if law.coverage.complete:
            break
    assert law.coverage.complete


def test_an_agent_that_comes_back_shares_the_work_again():
    mission = small_mission()
    law, _ = start_flying(mission)
    law.set_lost(np.array([True, False]))
    assert law._mission.fleet.lost == (0,)
    law.set_lost(np.array([False, False]))
    assert law._mission.fleet.lost == ()
    assert np.isfinite(law._mission.fleet.radius).all()


def test_a_slow_agent_is_planned_for_at_its_own_speed():
    mission = small_mission()
    law, plan = start_flying(mission)
    law.limit_speed(0, 0.5)
    result = law.step(mission.fleet.start, np.zeros((2, 2)), 0.0, deadline=None)
    speed = np.linalg.norm(result.plan.velocity, axis=2).max(axis=0)
    assert speed[0] <= 0.75 + 1e-6
    assert np.linalg.norm(plan.velocity, axis=2).max(axis=0)[0] > 0.75


def disturbed(**disturbance):
    raw = small_mission().spec.model_dump(by_alias=True, exclude_none=True)
    return build_mission({**raw, "disturbance": disturbance}, "small")


def test_bounds_are_tightened_by_the_tube():
    mission = disturbed(position_noise_m=0.01, input_noise_m_per_s2=0.05)
    law = RecedingHorizon(mission)
    tight, tube = law._mission.fleet, tube_of(mission)
    assert tube.position_m > 0.01
    assert tight.separation_min == pytest.approx(0.5 + 2 * tube.position_m)
    assert tight.communication_range == pytest.approx(3.0 - 2 * tube.position_m)
    assert tight.input_max == pytest.approx(1.5 - tube.input_m_per_s2)
    fly(mission, law)
    assert law.coverage.complete


def test_disturbances_that_leave_no_room_are_a_clear_error():
    near = [{"id": "a1", "start_m": [0.6, 0.6]}, {"id": "a2", "start_m": [1.2, 0.6]}]
    raw = small_mission(agents=near).spec.model_dump(by_alias=True, exclude_none=True)
    with pytest.raises(InvalidInputError, match="leaves no room"):
        RecedingHorizon(build_mission({**raw, "disturbance": {"position_noise_m": 0.1}}, "small"))


class FailingPlanner:
    """A planner of which nothing can be used."""

    def __init__(self, candidate):
        self.candidate = candidate

    def quick(self, task, deadline):
        return self.candidate

    whole = quick

    def evaluate(self, ocp, x):
        return SCPResult(x, 1.0, 9.0, ())

    def polish(self, ocp, x, iterations, deadline):
        return SCPResult(np.full_like(x, np.nan), 0.0, 0.0, ())


def start_flying(mission):
    law = RecedingHorizon(mission)
    start, still = mission.fleet.start, np.zeros_like(mission.fleet.start)
    return law, law.prepare(start, still, 0.0, deadline=None).plan


def test_nan_from_the_planner_never_leaves_the_controller():
    mission = small_mission()
    law, plan = start_flying(mission)
    law._planner = FailingPlanner(None)
    start = plan.position[1], plan.velocity[1]
    result = law.step(*start, PERIOD, deadline=None)
    assert result.plan_source is PlanSource.NEW  # the mission plan goes on
    assert holds(mission, result.plan, start)


def test_without_a_mission_plan_the_previous_plan_is_shifted_and_then_rest():
    mission = small_mission()
    law, plan = start_flying(mission)
    law._planner = FailingPlanner(Candidate(plan, 1.0, feasible=False, kind="useless"))
    law._whole, thinking = None, False
    for k in range(1, 12):
        start = plan.at(k * PERIOD)
        result = law.step(*start, k * PERIOD, deadline=None)
        assert result.plan_source is (PlanSource.REST if thinking else PlanSource.SHIFTED)
        thinking = law.wants_replan_at_rest
        assert holds(mission, result.plan, start)
    assert np.abs(start[1]).max() < 1e-9


def test_without_any_plan_it_brakes():
    mission = small_mission()
    law = RecedingHorizon(mission)
    law._planner = FailingPlanner(Candidate(start_flying(mission)[1], 1.0, feasible=False, kind="useless"))
    start = mission.fleet.start, np.array([[0.0, 1.0], [0.0, 1.0]])
    result = law.step(*start, 0.0, deadline=None)
    assert result.plan_source is PlanSource.BRAKE
    assert holds(mission, result.plan, start)


def test_when_all_is_covered_it_comes_to_rest():
    mission = small_mission()
    law, plan = start_flying(mission)
    law.coverage.first[:] = 0.0
    result = law.step(plan.position[2], plan.velocity[2], 2 * PERIOD, deadline=None)
    assert result.plan_source is PlanSource.REST
    assert np.abs(result.plan.velocity[2:]).max() == 0.0
    again = law.prepare(mission.fleet.start, np.zeros((2, 2)), 0.0, deadline=None)
    assert again.plan_source is PlanSource.REST


def test_a_missed_deadline_is_reported_and_the_plan_is_still_verified():
    mission = small_mission()
    law, plan = start_flying(mission)
    start = plan.position[1], plan.velocity[1]
    result = law.step(*start, PERIOD, deadline=time.perf_counter() - 1.0)
    assert result.deadline_missed
    assert holds(mission, result.plan, start)


@pytest.mark.parametrize("looks", [2, 5])
def test_several_looks_are_flown_to_the_end(looks):
    """More than one pass takes, too: what a mission plan leaves owed is in the next."""
    spec = small_mission().spec.model_dump(by_alias=True, exclude_none=True)
    spec["area"] |= {"looks": looks, "shape": {"kind": "box", "min_m": [0, 0], "max_m": [3.0, 2.5]}}
    mission = build_mission(spec, "small")
    law = RecedingHorizon(mission)
    fly(mission, law, limit=90)
    assert law.coverage.complete
    assert law.coverage.map.effective.min() >= looks


def test_an_unknown_back_end_is_a_clear_error():
    with pytest.raises(UserError, match="osqp"):
        RecedingHorizon(small_mission(), backend="cplex")


def test_planning_that_was_too_short_is_thought_over_for_twice_as_long(monkeypatch):
    """A first plan that stays at rest would be flown for ever; the fleet is at rest anyway."""
    mission = small_mission()
    law, asked = RecedingHorizon(mission), []
    whole = law._planner.whole

    def slow(task, deadline, effort_s):
        asked.append(effort_s)
        still = task.flown(rest_guess(task.position), task.least_steps)
        return evaluate_guess(task, rest_guess(task.position), still) if len(asked) < 3 else whole(task, deadline)

    monkeypatch.setattr(law._planner, "whole", slow)
    state = mission.fleet.start, np.zeros_like(mission.fleet.start)
    thoughts = []
    for _ in range(3):
        law.prepare(*state, 0.0, deadline=None)
        thoughts.append(law.wants_replan_at_rest)
    planning_s = mission.spec.control.planning_time_s
    assert asked == [planning_s, 2 * planning_s, 4 * planning_s]
    assert thoughts == [True, True, False]


def test_time_that_was_added_for_thinking_is_no_missed_deadline():
    mission = small_mission()
    state = mission.fleet.start, np.zeros_like(mission.fleet.start)
    missed = []
    for again in (False, True):
        law = RecedingHorizon(mission)
        law._trigger.wanted = again
        law._trigger.end()  # in vain, or not
        missed.append(law.prepare(*state, 0.0, deadline=time.perf_counter()).deadline_missed)
    assert missed == [True, False]


def test_thinking_in_vain_ends(monkeypatch):
    mission = small_mission()
    law = RecedingHorizon(mission)

    def nothing(task, deadline, effort_s):
        still = task.flown(rest_guess(task.position), task.least_steps)
        return evaluate_guess(task, rest_guess(task.position), still)

    monkeypatch.setattr(law._planner, "whole", nothing)
    thoughts = []
    for _ in range(4):
        law.prepare(mission.fleet.start, np.zeros_like(mission.fleet.start), 0.0, deadline=None)
        thoughts.append(law.wants_replan_at_rest)
    assert thoughts == [True, True, True, False]
