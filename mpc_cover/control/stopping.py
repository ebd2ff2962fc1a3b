"""Stopping in flight: the earliest motion to rest that is verified, braking at once where that is safe."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.model.braking import braking_trajectory, braking_velocities

if TYPE_CHECKING:
    from collections.abc import Iterator

    from mpc_cover.mission.fleet import Fleet
    from mpc_cover.model.fleet_state import FleetState
    from mpc_cover.model.trajectory import Trajectory


def stopping_motions(
    state: FleetState, incumbent: Trajectory | None, fleet: Fleet, period: float, steps: int
) -> Iterator[Trajectory]:
    """Yield motions to rest, the earliest first: braking at once, then later along the plan in force, then its end.

    Parameters
    ----------
    state : on a sample of the plan in force, if there is one.
    incumbent : the plan in force; without it all brake at once.
    fleet, period, steps : input limits, T_s [s], and the least number of steps of each motion.
    """
    yield braking_trajectory(state.position, state.velocity, fleet, state.time, period, steps)
    if incumbent is None:
        return
    rest = incumbent.remainder(state.time, state.position, state.velocity)
    moving = np.flatnonzero(rest.velocity.any(axis=(1, 2)))
    for kept in range(1, int(moving[-1]) + 1 if moving.size else 0):
        braking = braking_velocities(rest.velocity[kept], fleet, period)
        held = np.zeros((max(0, steps - kept - braking.shape[0]), *state.velocity.shape))
        yield state.trajectory(np.concatenate([rest.velocity[1 : kept + 1], braking, held]), period)
    yield rest
