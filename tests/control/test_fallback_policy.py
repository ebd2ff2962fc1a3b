"""The ladder: a verified plan, what was published last, shifted, and the brake; whatever the planner does."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from closed_loop import PERIOD, at_start, holds, small_mission, start_flying, step_budget

from mpc_cover.control.control_law import PlanSource
from mpc_cover.control.fallback_policy import best_proposal, stop_proposal
from mpc_cover.control.planning_constraints import PlanningConstraints
from mpc_cover.control.receding_horizon import RecedingHorizon
from mpc_cover.control.recovery import Mode
from mpc_cover.information.build import make_map
from mpc_cover.model.fleet_state import FleetState
from mpc_cover.model.trajectory import Trajectory
from mpc_cover.planning.candidate import Candidate
from mpc_cover.planning.initial_guess.guess import GuessKind, Origin
from mpc_cover.planning.planner import Planner
from mpc_cover.planning.scp import SCPResult


class FailingPlanner(Planner):
    """A planner of which nothing can be used."""

    def __init__(self, plan):
        super().__init__("piqp")
        self.candidate = Candidate(plan, 1.0, feasible=False, origin=Origin(GuessKind.GIVEN, "useless"))

    def thorough(self, task, budget):
        return self.candidate

    quick = thorough

    def evaluate(self, ocp, x):
        return SCPResult(x, 1.0, 9.0, ())

    def polish(self, ocp, x, iterations, budget):
        return SCPResult(np.full_like(x, np.nan), 0.0, 0.0, ())


class FailingInFlight(FailingPlanner):
    """Plans at rest, and then nothing can be used."""

    def thorough(self, task, budget):
        return Planner.thorough(self, task, budget)


class PoorInFlight(FailingPlanner):
    """Finds plans in flight that creep upwards for a long time, and leave most."""

    def quick(self, task, budget):
        later = np.zeros((40, *task.position.shape))
        later[:-1, :, 1] = 0.05 * task.fleet.speed_max.min()
        plan = Trajectory.from_velocities(task.position, task.velocity, later, task.start_time, task.period)
        return Candidate(plan, 1.0, feasible=True, origin=Origin(GuessKind.GIVEN, "poor"))


def flying_with(planner_of):
    """Return a law that flies with a planner made from a plan, and the plan, which is published."""
    mission = small_mission()
    _, plan = start_flying(mission)
    law = RecedingHorizon(mission, planner=planner_of(plan))
    return mission, law, plan


def test_nan_from_the_planner_never_leaves_the_controller():
    mission, law, _ = flying_with(FailingInFlight)
    first = law.step(at_start(mission), make_map(mission), step_budget())
    law.published(first.trajectory)
    plan = first.trajectory
    state = FleetState.nominal(plan.position[1], plan.velocity[1], PERIOD)
    proposal = law.step(state, make_map(mission), step_budget())
    assert proposal.source is PlanSource.NEW  # the mission plan goes on
    assert holds(mission, proposal.trajectory, state)


def test_without_a_mission_plan_the_previous_plan_is_shifted_and_then_rest():
    mission, law, plan = flying_with(FailingPlanner)
    law.published(plan)
    resting = False
    for k in range(1, 12):
        state = FleetState.nominal(*plan.at(k * PERIOD), k * PERIOD)
        proposal = law.step(state, make_map(mission), step_budget())
        assert holds(mission, proposal.trajectory, state)
        law.published(proposal.trajectory)
        resting = law.mode is Mode.REPLAN_AT_REST
        assert proposal.source is (PlanSource.REST if resting else PlanSource.SHIFTED)
    assert resting
    assert np.abs(state.velocity).max() < 1e-9


def test_a_fleet_that_is_to_plan_at_rest_does_not_fly_a_poor_plan_for_a_horizon_first():
    mission, law, plan = flying_with(PoorInFlight)
    state = FleetState.nominal(plan.position[0], np.zeros_like(plan.velocity[0]), PERIOD)
    proposal = law.step(state, make_map(mission), step_budget())
    law.published(proposal.trajectory)
    assert law.mode is Mode.REPLAN_AT_REST
    assert not proposal.trajectory.velocity.any(), "at once"


def test_without_any_plan_it_brakes():
    mission, law, _ = flying_with(FailingPlanner)
    state = FleetState.nominal(mission.fleet.start, np.array([[0.0, 1.0], [0.0, 1.0]]), 0.0)
    proposal = law.step(state, make_map(mission), step_budget())
    law.published(proposal.trajectory)
    assert proposal.source is PlanSource.BRAKE
    assert law.mode is Mode.BRAKE
    assert holds(mission, proposal.trajectory, state)


def making_way():
    """Return a mission, a state in which stopping comes too late for the one behind, and a plan that makes way."""
    mission = small_mission(agents=[{"id": "a1", "start_m": [0.6, 2.0]}, {"id": "a2", "start_m": [1.55, 2.0]}])
    state = FleetState.nominal(mission.fleet.start, np.array([[1.2, 0.0], [0.0, 0.0]]), 0.0)
    later = np.zeros((8, 2, 2))
    later[:2, :, 0] = [[0.5, 0.6], [0.0, 0.6]]
    return mission, state, state.trajectory(later, PERIOD)


@pytest.mark.parametrize("known", [True, False])
def test_a_plan_that_does_not_hold_gives_way_to_what_was_sent_last_and_that_to_the_brake(known):
    mission, constraints = small_mission(), PlanningConstraints(small_mission())
    _, incumbent = start_flying(mission)
    state = FleetState.nominal(*incumbent.at(PERIOD), PERIOD)
    broken = replace(incumbent, position=incumbent.position + 1.0)
    constraints.update(state, incumbent)
    proposal = best_proposal(constraints, state, broken, incumbent if known else None, "improved")
    assert proposal.source is (PlanSource.SHIFTED if known else PlanSource.BRAKE)
    assert proposal.reason == "no new plan passed the verifier"
    assert holds(mission, proposal.trajectory, state)


def test_a_plan_that_holds_is_cut_to_the_horizon_and_ends_at_rest():
    mission = small_mission()
    constraints, state = PlanningConstraints(mission), at_start(mission)
    long = np.zeros((30, 2, 2))
    long[:-1, :, 1] = 0.25
    plan = state.trajectory(long, PERIOD)
    proposal = best_proposal(constraints, state, plan, None, "improved")
    assert (proposal.source, proposal.reason) == (PlanSource.NEW, "improved")
    assert proposal.trajectory.steps == mission.spec.control.horizon_steps
    np.testing.assert_array_equal(proposal.trajectory.velocity[:5], plan.velocity[:5])
    assert holds(mission, proposal.trajectory, state)


def test_coming_to_rest_is_at_once_unless_only_the_plan_sent_last_is_safe():
    mission = small_mission()
    constraints, state = PlanningConstraints(mission), at_start(mission)
    stop = stop_proposal(constraints, state, None, "all is covered")
    assert (stop.source, stop.reason) == (PlanSource.REST, "all is covered")
    assert not stop.trajectory.velocity.any()
    mission, state, incumbent = making_way()
    constraints = PlanningConstraints(mission)
    constraints.update(state, incumbent)
    assert holds(mission, incumbent, state)
    assert not constraints.keeps(constraints.brake(state), state)
    on = stop_proposal(constraints, state, incumbent, "all is covered")
    assert on.source is PlanSource.SHIFTED
    assert holds(mission, on.trajectory, state)
    np.testing.assert_allclose(on.trajectory.velocity[1], incumbent.velocity[1], atol=1e-12)
    assert np.abs(on.trajectory.velocity).sum() <= np.abs(incumbent.velocity).sum() + 1e-9
