"""Makes the potential law of a mission from its `potential` section, with defaults that follow from the fleet."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.distributed.agent_controller import AgentController
from mpc_cover.distributed.message_relay import MOST_REPAIRS
from mpc_cover.distributed.parameters import AgentParameters
from mpc_cover.distributed.potential_functions import Coordination, CoverageShape, coordination_of
from mpc_cover.distributed.potential_law import Bounds, LawParameters, PotentialLaw
from mpc_cover.errors import UserError
from mpc_cover.information.build import sensor_of, settling_map
from mpc_cover.information.visibility import Visibility
from mpc_cover.mission.information import AgeingInformation, KalmanInformation
from mpc_cover.mission.potential_rules import braking_samples
from mpc_cover.model.constraint_tightening import tightened

if TYPE_CHECKING:
    from mpc_cover.information.residual_map import ResidualMap
    from mpc_cover.mission.fleet import Fleet
    from mpc_cover.mission.load import Mission

_LEAST_SILENCE = 6
"""Samples of silence after which a neighbour is lost, at the least."""
_COORDINATION_GAIN_PER_S = 0.1
"""Gain of the gradients of (6.1) and (6.5), over the square of the smallest sensing radius [1/s]; a plain choice."""
_LARGEST_BROADCAST, _READING = 1 << 20, 8
"""Bytes of a broadcast that are still accepted, and of a reading in it."""


def law_parameters(mission: Mission) -> LawParameters:
    """Return the law's tuning."""
    given, smallest = mission.spec.potential, mission.fleet.sensing_radius_min
    core = 0.5 * smallest if given.core_m is None else given.core_m
    pull = given.coordination_gain_m2_per_s
    if pull is None:
        pull = _COORDINATION_GAIN_PER_S * smallest**2
    return LawParameters(
        shape=CoverageShape(given.alpha, core),
        gain=math.inf if given.gain_m2_per_s is None else given.gain_m2_per_s,
        coordination_gain=pull,
        random=given.random_part,
        spare=given.spare_edges,
    )


def coordination_for(mission: Mission, fleet: Fleet) -> Coordination:
    """Return rho_B, R_B, rho_C and R_C of a mission's fleet, which may be tightened or without lost agents.

    Raises
    ------
    UserError
        They contradict each other.
    """
    given = mission.spec.potential
    try:
        return coordination_of(fleet, given.repel_within_m, given.attract_beyond_m)
    except ValueError as error:
        raise UserError(f"mission {mission.spec.name}: potential: {error}") from None


def law_of(mission: Mission, fleet: Fleet) -> PotentialLaw:
    """Return the law for a whole fleet of a mission.

    Raises
    ------
    UserError
        Agents that do not hear each other could meet, or bounds contradict each other.
    """
    force = fleet.input_max if mission.spec.fleet.dynamics == "double" else None
    bounds = Bounds(fleet.speed_max, force, fleet.motion_min, fleet.motion_max)
    coordination = coordination_for(mission, fleet)
    try:
        return PotentialLaw(
            mission.field.cell, bounds, coordination, law_parameters(mission), mission.spec.control.period_s
        )
    except ValueError as error:
        raise UserError(f"mission {mission.spec.name}: potential: {error}") from None


def check_flyable(mission: Mission) -> Fleet:
    """Return the fleet as the law may fly it, tightened by what disturbances make of it.

    Raises
    ------
    UserError
        The law cannot fly this mission.
    """
    if mission.spec.disturbance.slow_agents:
        raise UserError(
            f"mission {mission.spec.name}: disturbance.slow_agents: agents that do not know that they are slow "
            "cannot fly by the potential law: lower their speed_max_m_per_s instead"
        )
    if isinstance(mission.spec.information, AgeingInformation):
        raise UserError(
            f"mission {mission.spec.name}: information.kind ageing: agents that fly by the potential law end once "
            "nothing is owed, which on a patrol never is: fly it by the receding horizon (--controller mpc)"
        )
    _check_broadcast_size(mission)
    fleet = tightened(mission)
    law_of(mission, fleet)
    return fleet


def _check_broadcast_size(mission: Mission) -> None:
    """Refuse a Kalman mission whose broadcasts, each with the readings of many samples, would be too large."""
    if not isinstance(mission.spec.information, KalmanInformation):
        return
    fleet, size = mission.fleet, mission.spec.area.cell_size_m
    reach = float(fleet.radius[np.isfinite(fleet.radius)].max())
    across = 2.0 * reach / size + 1.0
    readings = min(mission.field.size, int(across**fleet.dimension)) * fleet.radius.shape[1]
    most = _LARGEST_BROADCAST // (_READING * (fleet.size + MOST_REPAIRS))
    if readings > most:
        raise UserError(
            f"mission {mission.spec.name}: information.kind kalman: a look takes up to {readings} readings, and agents "
            f"that fly by the potential law tell each other all of them: must be at most {most}: "
            f"make area.cell_size_m (now {size:g}) greater"
        )


def make_agent(mission: Mission, index: int, seed: int) -> AgentController[ResidualMap]:
    """Return the controller of agent number `index` of a mission, which runs the law by itself.

    The seed is the fleet's: from it come the common order of escapes and each agent's own random signal.

    Raises
    ------
    UserError
        The law cannot fly this mission.
    """
    fleet, field, given = check_flyable(mission), mission.field, mission.spec.potential
    sensing = Visibility(field, fleet.radius)
    sensor = sensor_of(mission, sensing)
    period, delay = mission.spec.control.period_s, given.delay_samples
    held = 0 if delay == "hops" else delay
    silence = max(_LEAST_SILENCE, braking_samples(mission.spec) + 4)
    parameters = AgentParameters(
        law=law_parameters(mission),
        period_s=period,
        patience=max(math.ceil(given.patience_s / period), fleet.size + held + 2),
        lost_after=given.lost_after_samples or silence,
        delay=held,
    )
    return AgentController(
        fleet,
        field,
        index,
        settling_map(mission, sensing),
        sensing,
        coordination=coordination_for(mission, fleet),
        parameters=parameters,
        order=np.random.default_rng([seed, 4]).permutation(field.size),
        rng=np.random.default_rng([seed, 3, index]),
        double=mission.spec.fleet.dynamics == "double",
        sensor=None if sensor is sensing else sensor,
    )
