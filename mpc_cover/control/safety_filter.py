"""The safety filter: every trajectory passes it before it is sent to the fleet.

An independent verifier, which shares no code with planning or solvers, checks each proposal against the mission's
bounds: finite numbers, start, dynamics, limits, box, separation and connectivity along the continuous path, rest at
the end. Bounds that the fleet's state already violates are relaxed to what the incumbent plan, or immediate braking,
attains (`constraint_relaxation`), and no further.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mpc_cover.control.constraint_relaxation import attainable_bounds, strict_bounds
from mpc_cover.control.held_plans import crossing
from mpc_cover.control.obstacle_trajectories import path_among
from mpc_cover.control.stopping import stopping_motions
from mpc_cover.model.braking import braking_trajectory
from mpc_cover.model.constraint_tightening import tightened, without_lost
from mpc_cover.model.trajectory import SNAP_S

if TYPE_CHECKING:
    from mpc_cover.control.constraint_relaxation import MotionBounds
    from mpc_cover.mission.load import Mission
    from mpc_cover.model.fleet_state import FleetState
    from mpc_cover.model.trajectory import Trajectory


@dataclass(frozen=True)
class Verdict:
    """Whether a trajectory is admitted, and if not, the reason in words."""

    admitted: bool
    reason: str = ""


class SafetyFilter:
    """Admits or rejects trajectories for a mission's fleet.

    Parameters
    ----------
    mission : its bounds apply, tightened by the tube of its disturbances.
    """

    def __init__(self, mission: Mission) -> None:
        self._fleet, self._control = tightened(mission), mission.spec.control

    def admit(
        self, trajectory: Trajectory, state: FleetState, incumbent: Trajectory | None, *, eased: bool = False
    ) -> Verdict:
        """Return whether a trajectory may be sent to a fleet in this state; `incumbent` is the one that was sent last.

        `eased` as in `held_plans.crossing`.

        Never raises on account of the trajectory.
        """
        if (problem := self._malformed(trajectory, state)) is not None:
            return Verdict(admitted=False, reason=problem)
        bounds = self._bounds(state, incumbent)
        failure = bounds.failure(path_among(trajectory, state), state.actual)
        failure = failure or crossing(trajectory, state, bounds.planned, self._known(state, incumbent), eased=eased)
        return Verdict(admitted=failure is None, reason=failure or "")

    def earliest_stop(self, state: FleetState, incumbent: Trajectory | None, *, on_sample: bool) -> Trajectory | None:
        """Return the earliest motion to rest that it admits; None where it admits none.

        Where the state is not `on_sample` of the plan in force, only braking at once, within the mission's own bounds.
        """
        control, fleet = self._control, without_lost(self._fleet, state.lost)
        motions = stopping_motions(
            state, incumbent if on_sample else None, fleet, control.period_s, control.horizon_periods
        )
        bounds = self._bounds(state, incumbent) if on_sample else strict_bounds(fleet)
        known = self._known(state, incumbent if on_sample else None)
        kept = (motion for motion in motions if bounds.keeps(path_among(motion, state), state.actual))
        return next((one for one in kept if crossing(one, state, bounds.planned, known) is None), None)

    def _bounds(self, state: FleetState, incumbent: Trajectory | None) -> MotionBounds:
        """Return the bounds that hold from a state on: the mission's, or those that a known motion attains."""
        fleet, known = without_lost(self._fleet, state.lost), self._known(state, incumbent)
        return attainable_bounds(fleet, [path_among(motion, state) for motion in known], state.actual)

    def _known(self, state: FleetState, incumbent: Trajectory | None) -> list[Trajectory]:
        """Return what is flown otherwise: the rest of the incumbent plan, and braking at once."""
        control, fleet = self._control, without_lost(self._fleet, state.lost)
        here = state.position, state.velocity
        known = [] if incumbent is None else [incumbent.remainder(state.time, *here)]
        return [*known, braking_trajectory(*here, fleet, state.time, control.period_s, control.horizon_periods)]

    def _malformed(self, trajectory: Trajectory, state: FleetState) -> str | None:
        """Return why a trajectory is none of this fleet from this state on, or None."""
        names = ("time", "position", "velocity", "input")
        arrays: dict[str, Any] = {name: getattr(trajectory, name, None) for name in names}
        for name, array in arrays.items():
            if not isinstance(array, np.ndarray) or not np.issubdtype(array.dtype, np.floating):
                return f"{name} must be an array of floating-point numbers"
        steps, shape = arrays["time"].size - 1, state.position.shape
        expected = {"time": (steps + 1,), "position": (steps + 1, *shape), "velocity": (steps + 1, *shape)}
        for name, wanted in {**expected, "input": (steps, *shape)}.items():
            if (found := arrays[name].shape) != wanted or steps < 1:
                return f"{name} has shape {found}, must be {wanted} with one step at the least"
        period = self._control.period_s
        grid = state.time + period * np.arange(steps + 1)
        if getattr(trajectory, "period", None) != period:  # agents are sent the period, not the times
            return f"period is {trajectory.period} s, must be {period:g} s"
        if not (np.abs(arrays["time"] - grid) <= SNAP_S * (1.0 + np.abs(grid))).all():
            return f"samples must lie every {period:g} s from {state.time:g} s on"
        for name, array in arrays.items():
            if not np.isfinite(array).all():
                return f"{name} must be finite"
        return None
