"""The controller in closed loop: it finishes, whatever is lost, slow, disturbed, or too short of time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from closed_loop import (
    PERIOD,
    at_start,
    first_plan,
    fly,
    holds,
    see_everything,
    small_mission,
    start_flying,
    step_budget,
)
from flights import mission_of

from mpc_cover.control.control_law import PlanSource
from mpc_cover.control.receding_horizon import RecedingHorizon
from mpc_cover.control.recovery import Mode
from mpc_cover.errors import InvalidInputError, UserError
from mpc_cover.information.build import make_map
from mpc_cover.mission.load import build_mission
from mpc_cover.model.constraint_tightening import without_lost
from mpc_cover.model.fleet_state import FleetState
from mpc_cover.model.trajectory import Trajectory
from mpc_cover.planning.budget import Budget
from mpc_cover.planning.initial_guess.guess import GuessKind, Origin
from mpc_cover.planning.initial_guess.rendezvous import out_of_range
from mpc_cover.planning.planner import Planner
from mpc_cover.planning.scp import SCPResult
from mpc_cover.service.run.simulate import simulate
from mpc_cover.verification.check import check_trajectory
from solvers.backends.registry import BACKENDS


@pytest.mark.parametrize("horizon", [4, 8, 30])
def test_the_closed_loop_finishes_whatever_the_horizon(horizon):
    mission = small_mission(horizon)
    coverage, states, proposals = fly(mission, RecedingHorizon(mission))
    assert coverage.complete
    assert {p.source for p in proposals} <= {PlanSource.NEW, PlanSource.SHIFTED, PlanSource.REST}
    assert sum(p.source is PlanSource.SHIFTED for p in proposals) < 0.2 * len(proposals)
    assert len(states) * PERIOD < 12.0
    assert all(p.trajectory.steps >= horizon for p in proposals)


@pytest.mark.parametrize("backend", ["osqp", "clarabel"])
def test_every_back_end_flies_it(backend):
    mission = small_mission()
    coverage, _, _ = fly(mission, RecedingHorizon(mission, backend=backend))
    assert coverage.complete


def test_small_disturbances_are_flown_out():
    mission = small_mission()
    rng = np.random.default_rng(3)
    coverage, _, _ = fly(mission, RecedingHorizon(mission), disturb=lambda _: rng.normal(scale=0.002, size=(2, 2)))
    assert coverage.complete


def test_two_runs_are_the_same():
    runs = [fly(small_mission(), RecedingHorizon(small_mission()))[1] for _ in range(2)]
    one, two = (np.array([(state.position, state.velocity) for state in run]) for run in runs)
    assert one.tobytes() == two.tobytes()


def test_a_lost_agent_becomes_an_obstacle_and_the_other_finishes():
    mission, coverage, lost = small_mission(), make_map(small_mission()), np.array([True, False])
    law = RecedingHorizon(mission)
    plan = first_plan(law, mission)
    resting = plan.position[4, 0]
    for k in range(5):
        coverage.observe(k * PERIOD, plan.position[k])
    state = replace(
        FleetState.nominal(plan.position[4], plan.velocity[4] * [[0.0], [1.0]], 4 * PERIOD),
        lost=lost,
    )
    for k in range(4, 120):
        proposal = law.step(state, coverage, step_budget())
        plan = proposal.trajectory
        law.published(plan)
        assert holds(mission, plan, state)
        assert np.abs(plan.position[:, 0] - resting).max() == 0.0
        assert np.linalg.norm(plan.position[:, 1] - resting, axis=1).min() >= 0.5
        for part in (0.5, 1.0):
            seen = plan.at((k + part) * PERIOD)[0].copy()
            seen[0] = np.nan
            coverage.observe((k + part) * PERIOD, seen)
        state = replace(state, position=plan.position[1], velocity=plan.velocity[1], time=(k + 1) * PERIOD)
        if coverage.complete:
            break
    assert coverage.complete


def test_a_slow_agent_is_planned_for_at_its_own_speed():
    mission = small_mission()
    law, plan = start_flying(mission)
    slow = replace(at_start(mission, settled=False), speed_share=np.array([0.5, 1.0]))
    found = law.step(slow, make_map(mission), step_budget()).trajectory
    speed = np.linalg.norm(found.velocity, axis=2).max(axis=0)
    assert speed[0] <= 0.75 + 1e-6
    assert np.linalg.norm(plan.velocity, axis=2).max(axis=0)[0] > 0.75


def disturbed(mission, **disturbance):
    raw = mission.spec.model_dump(by_alias=True, exclude_none=True)
    return build_mission({**raw, "disturbance": disturbance}, "small")


def test_it_finishes_within_bounds_that_are_tightened():
    mission = disturbed(small_mission(), position_noise_m=0.01, input_noise_m_per_s2=0.05)
    coverage, _, _ = fly(mission, RecedingHorizon(mission))
    assert coverage.complete


def test_disturbances_that_leave_no_room_are_a_clear_error():
    near = [{"id": "a1", "start_m": [0.6, 0.6]}, {"id": "a2", "start_m": [1.2, 0.6]}]
    with pytest.raises(InvalidInputError, match="leaves no room"):
        RecedingHorizon(disturbed(small_mission(agents=near), position_noise_m=0.1))


def test_when_all_is_covered_it_comes_to_rest():
    mission = small_mission()
    law, plan = start_flying(mission)
    coverage = make_map(mission)
    see_everything(coverage, mission)
    moving = FleetState.nominal(plan.position[2], plan.velocity[2], 2 * PERIOD)
    proposal = law.step(moving, coverage, step_budget())
    assert proposal.source is PlanSource.REST
    assert np.abs(proposal.trajectory.velocity[2:]).max() == 0.0
    again = law.step(at_start(mission), coverage, step_budget())
    law.published(again.trajectory)
    assert again.source is PlanSource.REST
    assert law.mode is Mode.STOP


def test_without_any_time_the_plan_is_verified_all_the_same():
    mission = small_mission()
    law, plan = start_flying(mission)
    state = FleetState.nominal(plan.position[1], plan.velocity[1], PERIOD)
    budget = Budget.wall_clock(-1.0)
    assert holds(mission, law.step(state, make_map(mission), budget).trajectory, state)
    assert budget.left_s < 0.0


@pytest.mark.parametrize("looks", [2, 5])
def test_several_looks_are_flown_to_the_end(looks):
    """More than one pass takes, too: what a mission plan leaves owed is in the next."""
    spec = small_mission().spec.model_dump(by_alias=True, exclude_none=True)
    spec["area"] |= {"looks": looks, "shape": {"kind": "box", "min_m": [0, 0], "max_m": [3.0, 2.5]}}
    mission = build_mission(spec, "small")
    coverage, _, _ = fly(mission, RecedingHorizon(mission), limit=90)
    assert coverage.complete
    assert coverage.map.effective.min() >= looks


def test_an_unknown_back_end_is_a_clear_error():
    with pytest.raises(UserError, match="osqp"):
        RecedingHorizon(small_mission(), backend="cplex")


def test_a_step_without_time_goes_on_or_asks_for_time_to_think():
    """Whatever comes of it holds; if nobody goes on, then because it is to be thought about, and only that long."""
    mission = small_mission(planning_time_s=1.0)
    law, plan = start_flying(mission)
    coverage, share = make_map(mission), np.array([1.0, 0.5])
    state = replace(
        FleetState.nominal(plan.position[2], plan.velocity[2] * [[1.0], [0.5]], 2 * PERIOD), speed_share=share
    )
    proposal = law.step(state, coverage, Budget.wall_clock(-1.0))
    assert holds(mission, proposal.trajectory, state)
    assert proposal.reason == "the ways as before" or law.mode is Mode.REPLAN_AT_REST
    law.published(proposal.trajectory)
    stopped = replace(
        state, position=proposal.trajectory.position[-1], velocity=np.zeros((2, 2)), time=9.0, settled=True
    )
    after = law.step(stopped, coverage, Budget.counted(mission.spec.control.planning_time_s))
    law.published(after.trajectory)
    assert law.mode is not Mode.REPLAN_AT_REST
    assert np.abs(after.trajectory.velocity).max() > 0.5


# plans that some have not heard of


class HastyPlanner(Planner):
    """Finds that everyone can fly on faster in the first sample."""

    def evaluate(self, ocp, x):
        return SCPResult(x, 1.0, 0.0, ())

    def polish(self, ocp, x, iterations, budget):
        position, velocity = ocp.motion(x)
        faster = np.where(np.arange(len(velocity))[:, None, None] == 1, 2.5 * velocity, velocity)
        return SCPResult(ocp.decision(position[0], faster), 0.5, 0.0, ())


class SlowStart(HastyPlanner):
    """Its plans are slow at first: everyone at 0.25 m/s, one behind the other."""

    def thorough(self, task, budget):
        slow = np.zeros((8, 2, 2))
        slow[:4, :, 0] = 0.25
        plan = Trajectory.from_velocities(task.position, task.velocity, slow, task.start_time, PERIOD)
        return replace(super().thorough(task, budget), plan=plan, feasible=True, origin=Origin(GuessKind.GIVEN, "slow"))


@pytest.mark.parametrize(("gap", "taken"), [(0.55, False), (1.6, True)])
def test_a_better_plan_is_not_taken_when_whoever_misses_it_is_in_the_way(gap, taken):
    """One behind the other, both as fast: faster together is well, but not if the one in front has not heard of it."""
    agents = [{"id": "a1", "start_m": [0.6, 2.0]}, {"id": "a2", "start_m": [0.6 + gap, 2.0]}]
    mission = small_mission(agents=agents)
    law, coverage = RecedingHorizon(mission, planner=SlowStart("piqp")), make_map(mission)
    assert np.abs(first_plan(law, mission).velocity).max() == 0.25
    proposal = law.step(at_start(mission, settled=False), coverage, step_budget())
    assert proposal.reason == ("more coverage" if taken else "no better")
    assert (proposal.trajectory.velocity[1, 0, 0] > 0.5) == taken


def test_a_mission_in_which_a_third_of_all_plans_is_lost_is_flown_all_the_same():
    mission = small_mission()
    rng = np.random.default_rng(5)
    dropped = []

    def channel(key, payload):
        if key.endswith("/plan") and rng.uniform() < 0.3:
            dropped.append(key)
            return []
        return [payload]

    result = simulate(mission, channel=channel)
    assert len(dropped) > 5
    assert result.complete
    report = check_trajectory(result.trajectory)
    assert report.holds, report.failures


# a relay is lost: those who are left meet, before anything else, and before the mission is over

START = [[1.0, 1.0], [3.0, 1.0], [5.0, 1.0]]


def mission_in_a_row(start=START, radius=2.0):
    """Return three agents in a row, whose middle one keeps the others in touch."""
    return mission_of(
        {
            "schema": 1,
            "name": "row",
            "area": {"shape": {"kind": "box", "min_m": [0.0, 0.0], "max_m": [6.0, 2.0]}, "cell_size_m": 0.5},
            "fleet": {
                "defaults": {"sensing_radius_m": radius, "input_max_m_per_s2": 1.5, "speed_max_m_per_s": 1.5},
                "agents": [{"id": f"a{i + 1}", "start_m": place} for i, place in enumerate(start)],
                "separation_min_m": 0.5,
                "communication_range_m": 2.5,
            },
            "control": {"period_s": 0.5, "horizon_steps": 12},
        }
    )


def go_on(law, state, coverage):
    """Step once, publish that, and return the proposal, and the state a period later."""
    proposal = law.step(state, coverage, step_budget())
    law.published(proposal.trajectory)
    later = proposal.trajectory.position[1], proposal.trajectory.velocity[1], state.time + PERIOD
    return proposal, replace(state, position=later[0], velocity=later[1], time=later[2])


def steps_after_losing(index):
    """Return the mission, the position and the reason of each step after everyone saw everything at once."""
    mission, lost = mission_in_a_row(), np.arange(3) == index
    law, coverage, told = RecedingHorizon(mission), make_map(mission), []
    coverage.observe(0.0, np.array(START))
    assert coverage.complete
    state = replace(FleetState.nominal(np.array(START), np.zeros((3, 2)), 0.0), lost=lost)
    for _ in range(12):
        proposal, state = go_on(law, state, coverage)
        told.append(proposal.reason)
    return without_lost(mission.fleet, lost), state.position, told


def test_they_meet_and_then_stop():
    fleet, position, told = steps_after_losing(1)
    assert told[0] == "rendezvous"
    assert told[-1] == "all is covered"
    assert not out_of_range(position, fleet)
    np.testing.assert_allclose(position[1], START[1])


def test_whoever_is_still_in_touch_stays():
    _, position, told = steps_after_losing(2)
    assert set(told) == {"all is covered"}
    np.testing.assert_allclose(position, START)


def test_those_who_cannot_stop_in_time_meet_before_they_go_on():
    """Still in touch when the relay dies, but not by the time that they can have stopped."""
    position = np.array([[1.8, 1.0], [3.0, 1.8], [4.2, 1.0]])
    velocity = np.array([[-0.5, 0.0], [0.0, 0.0], [0.5, 0.0]])
    mission = mission_in_a_row(position.tolist(), radius=0.6)
    law, coverage = RecedingHorizon(mission), make_map(mission)
    state = replace(FleetState.nominal(position, velocity, 0.0), lost=np.array([False, True, False]))
    told, length = [], []
    for _ in range(24):
        coverage.observe(state.time, np.where([[True], [False], [True]], state.position, np.nan))
        proposal, state = go_on(law, state, coverage)
        told.append(proposal.reason)
        length.append(float(np.linalg.norm(state.position[2] - state.position[0])))
    assert told[0] == "rendezvous"
    met = next(n for n, value in enumerate(length) if value <= 2.5)
    assert max(length[met:]) <= 2.5 + 1e-6
    assert max(length) < 2.6
    assert told[-1] != "rendezvous"


class ExposedPlanner(Planner):
    """A planner all of whose plans come too near to an agent that stops."""

    def thorough(self, task, budget):
        return replace(super().thorough(task, budget), braking_violation=1.0)

    def quick(self, task, budget):
        return replace(super().quick(task, budget), braking_violation=1.0)


def test_a_plan_that_is_not_passively_safe_is_not_taken_in_flight_where_a_safe_one_goes_on():
    """They finish their rendezvous and come to rest, where there is time for a better plan; there any is taken."""
    position = np.array([[1.8, 1.0], [3.0, 1.8], [4.2, 1.0]])
    velocity = np.array([[-0.5, 0.0], [0.0, 0.0], [0.5, 0.0]])
    mission = mission_in_a_row(position.tolist(), radius=0.6)
    law, coverage = RecedingHorizon(mission, planner=ExposedPlanner("piqp")), make_map(mission)
    state = replace(FleetState.nominal(position, velocity, 0.0), lost=np.array([False, True, False]))
    told = []
    for _ in range(24):
        proposal, state = go_on(law, state, coverage)
        told.append(proposal.reason)
        if law.mode is Mode.REPLAN_AT_REST and not state.velocity.any():
            break
    assert told[0] == "rendezvous"
    assert "no passively safe plan was found yet" in told
    assert not {reason.split()[0] for reason in told} & {"comb", "snake", "strips", "tour"}
    proposal, _ = go_on(law, replace(state, settled=True), coverage)
    assert proposal.source is PlanSource.NEW
    assert law.mode is Mode.NOMINAL


def test_a_flight_goes_on_with_another_back_end_and_says_who_answered(monkeypatch):
    able = replace(BACKENDS["piqp"].capabilities, variables_max=1)
    monkeypatch.setattr(BACKENDS["piqp"], "capabilities", able)
    mission = small_mission()
    coverage, _, proposals = fly(mission, RecedingHorizon(mission, backend="piqp"))
    assert coverage.complete
    assert any("QPs answered by others: clarabel " in proposal.reason for proposal in proposals)
