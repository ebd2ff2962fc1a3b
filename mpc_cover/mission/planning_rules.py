"""Validation of a mission's links and faults, and of its `planning`."""

from __future__ import annotations

from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.errors import Problem
from mpc_cover.mission.config import PlanEnd, PlanStart
from mpc_cover.mission.fleet import agent_input_max, agent_value

if TYPE_CHECKING:
    from collections.abc import Iterator

    from mpc_cover.arrays import FloatArray
    from mpc_cover.mission.config import MissionSpec

MAX_PLAN_STEPS = 2_000
MAX_MAGNITUDES = 200


def topology_problems(spec: MissionSpec) -> Iterator[Problem]:
    """Yield what is wrong with links that must be kept (4.19) and faults that must be tolerated (4.1)."""
    fleet = spec.fleet
    places = {agent.id: np.array(agent.start_m) for agent in fleet.agents}
    reach = fleet.communication_range_m
    for number, (one, two) in enumerate(fleet.links):
        path = f"fleet.links.{number}"
        if one not in places or two not in places or one == two:
            yield Problem(path, (one, two), f"must name two different agents of {list(places)}")
        elif reach is None:
            yield Problem(path, (one, two), "needs fleet.communication_range_m, which is missing")
        elif places[one].shape == places[two].shape and spec.planning.start is PlanStart.FIXED:
            distance = float(np.linalg.norm(places[one] - places[two]))
            if distance > reach:
                right = f"starts {distance:.3g} m long, must be at most communication_range_m {reach} m"
                yield Problem(path, (one, two), right)
    faults, agents = fleet.faults_tolerated, len(fleet.agents)
    if faults >= agents:
        yield Problem("fleet.faults_tolerated", faults, f"must be less than the number of agents, {agents}")
        return
    sets = sum(1 for _ in combinations(range(agents), faults)) if faults <= 4 else MAX_MAGNITUDES + 1  # noqa: PLR2004
    if sets * len(spec.magnitudes) > MAX_MAGNITUDES:
        right = f"gives {sets} or more sets of survivors, must give at most {MAX_MAGNITUDES} with all magnitudes"
        yield Problem("fleet.faults_tolerated", faults, right)
    for name in spec.magnitudes:
        able = sum(_measures(spec, index, name) for index in range(agents))
        if 0 < able <= faults:
            right = f"is measured by {able} agents, must be by more than faults_tolerated {faults}"
            yield Problem("magnitudes", name, right)


def planning_problems(spec: MissionSpec) -> Iterator[Problem]:
    """Yield what is wrong with the duration and the ends of offline plans."""
    planning, fleet, period = spec.planning, spec.fleet, spec.control.plan_step
    unit = "periods" if spec.control.substeps == 1 else "steps"
    if (duration_s := planning.duration_s) is not None:
        if duration_s < 2 * period:
            yield Problem("planning.duration_s", duration_s, f"must be at least two {unit} of {period:g} s")
        if duration_s > MAX_PLAN_STEPS * period:
            right = f"must be at most {MAX_PLAN_STEPS} {unit} of {period:g} s"
            yield Problem("planning.duration_s", duration_s, right)
    if planning.end is not PlanEnd.FIXED:
        return
    for index, agent in enumerate(fleet.agents):
        path = f"fleet.agents.{index}.end_m"
        if agent.end_m is None:
            yield Problem(path, None, "is missing: planning.end is fixed")
        elif len(agent.end_m) != len(agent.start_m):
            yield Problem(path, agent.end_m, f"must have {len(agent.start_m)} coordinates like start_m")
        else:
            yield from _reach_problems(spec, index)
    yield from _end_pairs(spec)


def _end_pairs(spec: MissionSpec) -> Iterator[Problem]:
    fleet = spec.fleet
    for (i, one), (j, two) in combinations(enumerate(fleet.agents), 2):
        if one.end_m is None or two.end_m is None or len(one.end_m) != len(two.end_m):
            continue
        distance = float(np.linalg.norm(np.array(one.end_m) - np.array(two.end_m)))
        if distance < fleet.separation_min_m:
            right = f"is {distance:.3g} m from agent {i}'s end, must be at least {fleet.separation_min_m} m"
            yield Problem(f"fleet.agents.{j}.end_m", two.end_m, right)
    yield from _end_connections(spec)


def _end_connections(spec: MissionSpec) -> Iterator[Problem]:
    """Yield the ends that are out of range: no plan could end there (4.19, 4.20)."""
    fleet, reach = spec.fleet, spec.fleet.communication_range_m
    ends = {agent.id: np.array(agent.end_m) for agent in fleet.agents if agent.end_m is not None}
    if reach is None or len(ends) < len(fleet.agents) or len({end.shape for end in ends.values()}) > 1:
        return  # already reported, agent by agent
    for index in unreached(np.array(list(ends.values())), reach):
        right = f"is not connected to {fleet.agents[0].id}'s end within communication_range_m {reach} m"
        yield Problem(f"fleet.agents.{index}.end_m", fleet.agents[index].end_m, right)
    for number, (one, two) in enumerate(fleet.links):
        if one not in ends or two not in ends:
            continue
        distance = float(np.linalg.norm(ends[one] - ends[two]))
        if distance > reach:
            right = f"ends {distance:.3g} m long, must be at most communication_range_m {reach} m"
            yield Problem(f"fleet.links.{number}", (one, two), right)


def unreached(place: FloatArray, reach: float | None) -> list[int]:
    """Return the indices of (m, d) places [m] not connected with the first by edges of at most `reach` [m]."""
    if reach is None:
        return []
    near = np.linalg.norm(place[:, None] - place[None], axis=2) <= reach
    joined = near[0]
    for _ in place:
        joined = near[joined].any(axis=0)
    return np.flatnonzero(~joined).tolist()


def _reach_problems(spec: MissionSpec, index: int) -> Iterator[Problem]:
    """Yield a problem if the end cannot be reached in time: rest to rest, straight, at full input and speed."""
    agent = spec.fleet.agents[index]
    speed, force = agent_value(spec, agent, "speed_max_m_per_s"), agent_input_max(spec, agent)
    path = f"fleet.agents.{index}.end_m"
    low, high = spec.area.motion_min_m, spec.area.motion_max_m
    assert agent.end_m is not None
    for corner, sign in ((low, 1.0), (high, -1.0)):
        if corner is not None and any(sign * (q - c) < 0.0 for q, c in zip(agent.end_m, corner, strict=False)):
            yield Problem(path, agent.end_m, f"must lie where agents may move, within {low} and {high}")
            return
    if spec.planning.start is not PlanStart.FIXED or not isinstance(speed, float) or force is None:
        return
    distance = float(np.linalg.norm(np.array(agent.end_m) - np.array(agent.start_m)))
    ramp = min(distance, speed**2 / force)
    needed = 2.0 * np.sqrt(ramp / force) + (distance - ramp) / speed
    if spec.planning.duration_s is not None and needed > spec.planning.duration_s:
        right = f"is {distance:.3g} m away and takes {needed:.3g} s: planning.duration_s must be at least that"
        yield Problem(path, agent.end_m, right)


def _measures(spec: MissionSpec, index: int, magnitude: str) -> bool:
    radius = agent_value(spec, spec.fleet.agents[index], "sensing_radius_m")
    return magnitude in radius if isinstance(radius, dict) else radius is not None
