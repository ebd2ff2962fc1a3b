"""Simulates the distributed law on missions, as chapters 5 and 6 do: each agent's map delayed as the study asks."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Literal

from mpc_cover.distributed.setup import coordination_for, law_of, law_parameters
from mpc_cover.errors import UserError
from mpc_cover.mission import information as kinds
from mpc_cover.mission.information import InformationKind
from mpc_cover.studies.starts import Starts, random_starts
from mpc_cover.studies.swarm import fly
from mpc_cover.studies.swarm_parameters import KalmanInformation, LookInformation, SwarmParameters

if TYPE_CHECKING:
    from mpc_cover.mission.load import Mission
    from mpc_cover.studies.swarm_parameters import Information
    from mpc_cover.studies.swarm_record import SwarmRecord


def information_of(mission: Mission) -> Information:
    """Return what "measured" means in a mission.

    Raises
    ------
    UserError
        The simulation supports coverage, looks and Kalman filters only.
    """
    given = mission.spec.information
    if isinstance(given, kinds.KalmanInformation):
        return KalmanInformation(given.prior_variance, given.noise_variance, given.target_variance, given.field.bumps)
    kind = mission.spec.information_kind
    if kind not in {InformationKind.COVERAGE, InformationKind.LOOKS}:
        raise UserError(f"mission {mission.spec.name}: information.kind {kind}: must be coverage, looks or kalman")
    return LookInformation(mission.spec.looks)


def swarm_of(mission: Mission, *, delay: int | Literal["hops"] | None = None, maps_every: int = 0) -> SwarmParameters:
    """Return the parameters to fly a mission in one process; `delay` replaces the mission's own.

    Raises
    ------
    UserError
        The law cannot fly it.
    """
    given, control = mission.spec.potential, mission.spec.control
    law_of(mission, mission.fleet)
    bounds = coordination_for(mission, mission.fleet)
    return SwarmParameters(
        information=information_of(mission),
        delay=given.delay_samples if delay is None else delay,
        law=replace(law_parameters(mission), spare=False),
        dynamics=mission.spec.fleet.dynamics,
        period_s=control.period_s,
        repel_within_m=bounds.repel_within_m,
        attract_beyond_m=bounds.attract_beyond_m,
        patience_s=given.patience_s,
        time_limit_s=control.time_limit_s,
        maps_every=maps_every,
    )


def fly_mission(
    mission: Mission,
    seed: int,
    *,
    delay: int | Literal["hops"] | None = None,
    maps_every: int = 0,
    starts: Starts = Starts.MISSION,
) -> SwarmRecord:
    """Fly a mission once, from its own starts or from random ones; arguments else as those of `swarm_of`.

    Raises
    ------
    UserError
        The law cannot fly it, or there is no room for random starts.
    """
    fleet = mission.fleet
    if starts == Starts.RANDOM:
        fleet = replace(fleet, start=random_starts(mission, seed))
    return fly(fleet, mission.field, swarm_of(mission, delay=delay, maps_every=maps_every), seed)
