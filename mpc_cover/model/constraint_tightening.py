"""Constraint tightening for tube MPC, and the fleet without lost agents and with reduced speed limits."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.errors import InvalidInputError, Problem
from mpc_cover.model.fleet_constraints import FleetConstraints
from mpc_cover.model.tube import tube_of

if TYPE_CHECKING:
    from mpc_cover.arrays import BoolArray, FloatArray
    from mpc_cover.mission.fleet import Fleet
    from mpc_cover.mission.load import Mission


def tightened(mission: Mission) -> Fleet:
    """Return the fleet with every bound tightened by the tube, so that nominal plans are robustly feasible.

    References within the tightened bounds keep the true motion within the mission's (tube MPC: Mayne, Seron
    and Rakovic, 2005): two agents deviate towards each other by two tube radii at most. Sensing radii are reduced by
    the tube radius, too, so that the disturbed motion covers what the plan covers as measured with noisy positions.

    Raises
    ------
    InvalidInputError
        The disturbances are too strong: the tightened bounds contradict each other, or the start violates them.
    """
    fleet, tube = mission.fleet, tube_of(mission)
    radius = tube.position_m
    if radius == 0.0 and tube.input_m_per_s2 == 0.0:
        return fleet
    # the map counts a cell when the measured position is within rho less the noise
    blur = radius + 2.0 * mission.spec.disturbance.position_noise_m
    tighter = replace(
        fleet,
        radius=fleet.radius - blur,
        input_max=fleet.input_max - tube.input_m_per_s2,
        speed_max=fleet.speed_max - tube.velocity_m_per_s,
        separation_min=fleet.separation_min + 2.0 * radius if fleet.separation_min > 0.0 else 0.0,
        communication_range=fleet.communication_range - 2.0 * radius,
        motion_min=fleet.motion_min + radius,
        motion_max=fleet.motion_max - radius,
    )
    problems = _contradictions(tighter, radius)
    if problems:
        raise InvalidInputError(f"mission {mission.spec.name}", problems)
    return tighter


def _contradictions(fleet: Fleet, radius: float) -> list[Problem]:
    problems = []
    why = f"leaves no room: with it agents deviate up to {radius:.3g} m from their plans"
    if fleet.input_max.min() <= 0.0 or fleet.speed_max.min() <= 0.0:
        problems.append(Problem("disturbance", "too strong", f"{why}, and input or speed is used up"))
    if fleet.radius[np.isfinite(fleet.radius)].min() <= 0.0:
        problems.append(Problem("disturbance", "too strong", f"{why}, and nothing is left of a sensing radius"))
    distance = np.linalg.norm(fleet.start[:, None] - fleet.start[None], axis=2)[np.triu_indices(fleet.size, 1)]
    if distance.size and distance.min() < fleet.separation_min:
        right = f"{why}; starts must be {fleet.separation_min:.3g} m apart, the nearest are {distance.min():.3g} m"
        problems.append(Problem("fleet.agents", "starts", right))
    if fleet.communication_range <= fleet.separation_min:
        problems.append(Problem("fleet.communication_range_m", fleet.communication_range, why))
    if ((fleet.start < fleet.motion_min) | (fleet.start > fleet.motion_max)).any():
        right = f"{why}; starts must be that far inside the box that agents stay in"
        problems.append(Problem("fleet.agents", "starts", right))
    return problems


def without_lost(fleet: Fleet, lost: BoolArray) -> FleetConstraints:
    """Return the fleet in which agents of the (m,) mask are static obstacles that neither measure nor relay."""
    radius = np.where(lost[:, None], -np.inf, fleet.radius)
    links = tuple(link for link in fleet.links if not lost[list(link)].any())
    return FleetConstraints.of(fleet, radius=radius, links=links, lost=tuple(int(i) for i in np.flatnonzero(lost)))


def slowed(fleet: FleetConstraints, share: FloatArray) -> FleetConstraints:
    """Return the fleet with each speed limit [m/s] multiplied by the agent's (m,) share."""
    return replace(fleet, speed_max=fleet.speed_max * share)
