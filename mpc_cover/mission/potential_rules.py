"""Validation of a mission's `potential`."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from mpc_cover.errors import Problem
from mpc_cover.mission.config import Dynamics
from mpc_cover.mission.fleet import agent_input_max, agent_radii, agent_value

if TYPE_CHECKING:
    from collections.abc import Iterator

    from mpc_cover.mission.config import MissionSpec


def potential_problems(spec: MissionSpec) -> Iterator[Problem]:
    """Yield what is wrong with the potentials' bounds (6.1, 6.5), the core (5.9) and the delays."""
    law, fleet = spec.potential, spec.fleet
    near, far = fleet.separation_min_m, fleet.communication_range_m
    if (begin := law.repel_within_m) is not None:
        if near == 0.0:
            yield Problem("potential.repel_within_m", begin, "needs fleet.separation_min_m, which is 0")
        elif begin <= near or (far is not None and begin > far):
            most = "" if far is None else f", and at most communication_range_m {far:g}"
            yield Problem("potential.repel_within_m", begin, f"must be greater than separation_min_m {near:g}{most}")
    if (begin := law.attract_beyond_m) is not None:
        if far is None:
            yield Problem("potential.attract_beyond_m", begin, "needs fleet.communication_range_m, which is missing")
        elif begin >= far:
            yield Problem("potential.attract_beyond_m", begin, f"must be less than communication_range_m {far:g}")
    yield from _core_problems(spec)
    yield from _silence_problems(spec)
    if fleet.dynamics is Dynamics.SINGLE and (given := spec.disturbance) != type(given)():
        yield Problem("disturbance", "given", "needs fleet.dynamics double: nothing disturbs single integrators")


def _core_problems(spec: MissionSpec) -> Iterator[Problem]:
    core, smallest = spec.potential.core_m, smallest_radius(spec)
    if core is not None and smallest is not None and core > smallest:
        right = f"must be at most the smallest sensing radius, {smallest:g}: else cells are left that attract nobody"
        yield Problem("potential.core_m", core, right)


def _silence_problems(spec: MissionSpec) -> Iterator[Problem]:
    given, least = spec.potential.lost_after_samples, braking_samples(spec)
    if given is not None and given <= least:
        right = f"must be at least {least + 1}: whoever is lost must have come to rest, which takes {least} samples"
        yield Problem("potential.lost_after_samples", given, right)


def smallest_radius(spec: MissionSpec) -> float | None:
    """Return the smallest sensing radius of any agent for any magnitude [m]; None if none is given."""
    given = [agent for agent in spec.fleet.agents if agent_value(spec, agent, "sensing_radius_m") is not None]
    radii = [float(radius) for agent in given for radius in agent_radii(spec, agent) if math.isfinite(radius)]
    return min(radii, default=None)


def braking_samples(spec: MissionSpec) -> int:
    """Return how many periods the slowest to brake takes from full speed; 0 for single integrators."""
    if spec.fleet.dynamics is Dynamics.SINGLE:
        return 0
    longest = 0
    for agent in spec.fleet.agents:
        speed, force = agent_value(spec, agent, "speed_max_m_per_s"), agent_input_max(spec, agent)
        if isinstance(speed, float) and force is not None:
            longest = max(longest, math.ceil(speed / (force * spec.control.period_s) - 1e-9))
    return longest
