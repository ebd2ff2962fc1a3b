"""The control law of a simulated controller: it takes virtual time, and fails where a fault has it fail."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from mpc_cover.control.control_law import ControlLaw, ImprovesWhenIdle, Proposal
from mpc_cover.service.torture.faults import Fault, FaultKind

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mpc_cover.arrays import FloatArray
    from mpc_cover.control.recovery import Mode
    from mpc_cover.information.demand import DemandMap
    from mpc_cover.mission.fleet import Fleet
    from mpc_cover.model.fleet_state import FleetState
    from mpc_cover.model.trajectory import Trajectory
    from mpc_cover.planning.budget import Budget
    from mpc_cover.service.torture.processes import Process

SOLVER_FAULTS = ("raises", "nan", "infinite", "collides", "scatters", "too fast", "elsewhere", "no proposal", "late")
"""What a control law with a faulty solver does."""


_SCATTER = 8.0
"""How many times farther from its middle a fleet scatters, within its box; a plain choice."""

_SPEED_SHARE = 0.6
"""Part of the speed limit that such a motion adds to braking; a plain choice."""


class SolverError(Exception):
    """What a law raises whose solver fails."""


class FaultyLaw:
    """A control law in a process of the simulated world; see `ControlLaw`.

    Parameters
    ----------
    law : what decides.
    process : in which it runs: it takes the virtual time that its work was counted to take.
    faults : of solvers among them, those that strike it.
    work_s : seconds of work that are counted in a second of virtual time.
    fleet : the mission's, for the box that it stays in.
    """

    def __init__(self, law: ControlLaw, process: Process, faults: Sequence[Fault], work_s: float, fleet: Fleet) -> None:
        self._law, self._process, self._work_s, self._fleet = law, process, work_s, fleet
        self._faults = [fault for fault in faults if fault.kind is FaultKind.SOLVER]
        self.tolerates_losses = law.tolerates_losses

    @property
    def mode(self) -> Mode:
        """The mode of the law."""
        return self._law.mode

    def published(self, trajectory: Trajectory) -> None:
        """Notify the law of what was sent."""
        self._law.published(trajectory)

    def step(self, state: FleetState, coverage: DemandMap, budget: Budget) -> Any:
        """Return the law's proposal, or what a fault makes of it; later, as it takes time."""
        before_s = budget.left_s
        proposal = self._law.step(state, coverage, budget)
        self._take(before_s, before_s - budget.left_s)
        fault = next((fault for fault in self._faults if fault.on(self._process.time.now_s)), None)
        return proposal if fault is None else self._failing(fault, proposal, state)

    def improve(self, budget: Budget) -> bool:
        """Let the law improve its plan; that takes time, too."""
        if not isinstance(self._law, ImprovesWhenIdle):
            return False
        before_s = budget.left_s
        more = self._law.improve(budget)
        self._take(before_s, before_s - budget.left_s)
        return more

    def _take(self, budget_s: float, counted_s: float) -> None:
        """Let the virtual time pass that work takes; what exceeds its budget would be no more with a larger one."""
        within_s = min(counted_s, max(budget_s, 0.0))
        takes_s = within_s / self._work_s + counted_s - within_s
        self._process.wait_until(self._process.time.now_s + takes_s)

    def _failing(self, fault: Fault, proposal: Proposal, state: FleetState) -> Any:
        """Return what a fault makes of a proposal.

        Raises
        ------
        SolverError
            That is what it does.
        """
        if fault.way == "raises":
            raise SolverError("the solver broke down")
        if fault.way == "no proposal":
            return None
        if fault.way == "late":
            self._process.wait_until(self._process.time.now_s + fault.delay_s)
            return proposal
        return replace(proposal, trajectory=self._spoilt(fault.way, proposal.trajectory, state))

    def _spoilt(self, way: str, plan: Trajectory, state: FleetState) -> Trajectory:
        """Return a trajectory that no filter may pass."""
        middle, slowest = state.position.mean(axis=0), float(self._fleet.speed_max.min())
        match way:
            case "nan":
                return replace(plan, input=np.full_like(plan.input, np.nan))
            case "infinite":
                return replace(plan, velocity=np.full_like(plan.velocity, np.inf))
            case "too fast":
                later = np.zeros_like(plan.velocity[1:])
                later[: (plan.steps - 1) // 2] = 2.0 * plan.velocity[2::2][: (plan.steps - 1) // 2]
                return state.trajectory(later, plan.period)
            case "elsewhere":
                return replace(plan, position=plan.position + 0.5)
            case "scatters":
                away = middle + _SCATTER * (state.position - middle)
                return _to(np.clip(away, self._fleet.motion_min, self._fleet.motion_max), plan, state, slowest)
            case _:
                return _to(np.broadcast_to(middle, state.position.shape), plan, state, slowest)


def _to(target: FloatArray, plan: Trajectory, state: FleetState, speed_max: float) -> Trajectory:
    """Return a motion as long as the plan, towards positions (m, d) [m] and to rest, no faster than agents can fly."""
    number = np.arange(1, plan.steps + 1)
    braking = (1.0 - number / plan.steps)[:, None, None] * state.velocity
    stop = state.trajectory(braking, plan.period).position[-1]
    rises = np.minimum(number, plan.steps - number).astype(float)
    share = rises / max(rises.sum(), 1.0) / plan.period
    way = target - stop
    longest = np.linalg.norm(way, axis=1).max() * share.max()
    way *= min(1.0, _SPEED_SHARE * speed_max / longest) if longest > 0.0 else 1.0
    return state.trajectory(braking + share[:, None, None] * way, plan.period)
