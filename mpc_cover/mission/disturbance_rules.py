"""Validation of a mission's `disturbance`."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.errors import Problem
from mpc_cover.mission.fleet import agent_input_max, agent_value

if TYPE_CHECKING:
    from collections.abc import Iterator

    from mpc_cover.mission.config import AgentSpec, MissionSpec

LARGEST_PUSH = 0.4
"""Part of an agent's input that gusts and wind may take away."""
LARGEST_NOISE = 0.25
"""Part of a sensing radius that the noise of positions may be."""


def disturbance_problems(spec: MissionSpec) -> Iterator[Problem]:
    """Yield what is wrong with the bounds on disturbances."""
    given, agents = spec.disturbance, spec.fleet.agents
    if wrong := sorted(set(given.slow_agents) - {agent.id for agent in agents}):
        right = f"unknown agents {wrong}: must be among {[agent.id for agent in agents]}"
        yield Problem("disturbance.slow_agents", dict(given.slow_agents), right)
    if given.delay_s > spec.control.period_s:
        yield Problem("disturbance.delay_s", given.delay_s, f"must be at most period_s {spec.control.period_s}")
    wind = given.wind_m_per_s2
    if wind and len(wind) != len(agents[0].start_m):
        right = f"must have {len(agents[0].start_m)} coordinates like start_m, or none"
        yield Problem("disturbance.wind_m_per_s2", wind, right)
        return
    yield from _push_problems(spec)
    yield from _noise_problems(spec)


def _push_problems(spec: MissionSpec) -> Iterator[Problem]:
    """Yield a problem when gusts and wind leave the weakest agent too little input to fly with."""
    given = spec.disturbance
    wind = float(np.linalg.norm(given.wind_m_per_s2)) if given.wind_m_per_s2 else 0.0
    limits = [limit for agent in spec.fleet.agents if (limit := agent_input_max(spec, agent)) is not None]
    if not limits:
        return  # already reported, agent by agent
    push, room = given.input_noise_m_per_s2 + wind, LARGEST_PUSH * min(limits)
    if push > room:
        name = "wind_m_per_s2" if wind > given.input_noise_m_per_s2 else "input_noise_m_per_s2"
        right = f"gusts and wind come to {push:.3g}, must be at most {room:.3g}: {LARGEST_PUSH:g} of the smallest input"
        yield Problem(f"disturbance.{name}", getattr(given, name), right)


def _noise_problems(spec: MissionSpec) -> Iterator[Problem]:
    noise = spec.disturbance.position_noise_m
    radii = [radius for agent in spec.fleet.agents for radius in _radii(spec, agent)]
    if radii and noise > LARGEST_NOISE * min(radii):
        room = LARGEST_NOISE * min(radii)
        right = f"must be at most {room:.3g}: {LARGEST_NOISE:g} of the smallest sensing radius"
        yield Problem("disturbance.position_noise_m", noise, right)


def _radii(spec: MissionSpec, agent: AgentSpec) -> list[float]:
    radius = agent_value(spec, agent, "sensing_radius_m")
    if isinstance(radius, dict):
        return list(radius.values())
    return [radius] if isinstance(radius, float) else []
