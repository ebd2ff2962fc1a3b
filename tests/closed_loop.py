"""Two agents on a small square, flown in closed loop without a network."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mpc_cover.control.receding_horizon import RecedingHorizon
from mpc_cover.control.safety_filter import SafetyFilter
from mpc_cover.information.build import make_map
from mpc_cover.mission.load import Mission, build_mission
from mpc_cover.model.constraint_tightening import without_lost
from mpc_cover.model.fleet_state import FleetState
from mpc_cover.planning.budget import Budget
from mpc_cover.verification.motion import verify_motion

if TYPE_CHECKING:
    from collections.abc import Callable

    from mpc_cover.arrays import FloatArray
    from mpc_cover.control.control_law import ControlLaw, Proposal
    from mpc_cover.information.demand import FlownMap
    from mpc_cover.model.trajectory import Trajectory

PERIOD = 0.5
CREDIT_S = 0.25
"""Counted work of a step [s], half a period."""


def small_mission(horizon: int = 8, *, planning_time_s: float = 6.0, **fleet: Any) -> Mission:
    """Return two agents on a square of 5 m, with changes to the fleet."""
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
        "control": {"period_s": PERIOD, "horizon_steps": horizon, "planning_time_s": planning_time_s},
    }
    return build_mission(raw, "small")


def at_start(mission: Mission, *, settled: bool = True) -> FleetState:
    """Return the state at a mission's start, at rest."""
    return FleetState.nominal(mission.fleet.start, np.zeros_like(mission.fleet.start), 0.0, settled=settled)


def step_budget() -> Budget:
    """Return the counted work that a step in flight has."""
    return Budget.counted(CREDIT_S)


def first_plan(law: ControlLaw, mission: Mission, coverage: FlownMap | None = None) -> Trajectory:
    """Have the law plan from the mission's start, and publish that."""
    budget = Budget.counted(mission.spec.control.planning_time_s)
    proposal = law.step(at_start(mission), coverage or make_map(mission), budget)
    law.published(proposal.trajectory)
    return proposal.trajectory


def start_flying(mission: Mission) -> tuple[RecedingHorizon, Trajectory]:
    """Return a law whose first plan is published, and the plan."""
    law = RecedingHorizon(mission)
    return law, first_plan(law, mission)


def holds(mission: Mission, plan: Trajectory, state: FleetState) -> bool:
    """Return whether the verifier passes a plan from a state, with the mission's own bounds."""
    start = state.position, state.velocity
    fleet = without_lost(mission.fleet, state.lost)
    report = verify_motion(fleet, plan.time, plan.position, plan.velocity, plan.input, at_rest=True, start=start)
    return report.holds


def fly(
    mission: Mission, law: ControlLaw, limit: int = 60, disturb: Callable[[int], FloatArray] | None = None
) -> tuple[FlownMap, list[FleetState], list[Proposal]]:
    """Fly the closed loop with exact agents, to rest with all covered; return the map, states and proposals.

    Every proposal is verified, passes the safety filter, and is published.
    """
    coverage, state, gate, plan = make_map(mission), at_start(mission), SafetyFilter(mission), None
    coverage.observe(0.0, state.position)
    budget = Budget.counted(mission.spec.control.planning_time_s)
    states, proposals = [state], []
    for k in range(limit):
        proposal = law.step(state, coverage, budget)
        verdict = gate.admit(proposal.trajectory, state, plan)
        assert verdict.admitted, verdict.reason
        plan = proposal.trajectory
        assert holds(mission, plan, state)
        law.published(plan)
        proposals.append(proposal)
        for part in (0.2, 0.4, 0.6, 0.8, 1.0):
            coverage.observe((k + part) * PERIOD, plan.at((k + part) * PERIOD)[0])
        position, velocity = plan.position[1], plan.velocity[1]
        if disturb is not None:
            position = position + disturb(k)
        state, budget = FleetState.nominal(position, velocity, (k + 1) * PERIOD), step_budget()
        states.append(state)
        if coverage.complete and np.abs(velocity).max() < 1e-9:
            break
    return coverage, states, proposals


def see_everything(coverage: FlownMap, mission: Mission) -> None:
    """Have the map observe every cell at mission time 0."""
    others = mission.fleet.start[1:]
    for cell in mission.field.cell:
        coverage.observe(0.0, np.concatenate([cell[None], others]))
    assert coverage.complete
