"""Validation of a mission across its fields; all mistakes are found in one pass."""

from __future__ import annotations

import math
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.errors import Problem
from mpc_cover.mission.cell_rules import coarse_problems
from mpc_cover.mission.clipping import polygon_of
from mpc_cover.mission.config import BoxShape, PolygonShape
from mpc_cover.mission.disturbance_rules import disturbance_problems
from mpc_cover.mission.field import bounding_box, build_field
from mpc_cover.mission.fleet import agent_input_max, agent_value
from mpc_cover.mission.geographic_rules import geographic_problems
from mpc_cover.mission.information_rules import information_problems
from mpc_cover.mission.planning_rules import planning_problems, topology_problems, unreached
from mpc_cover.mission.potential_rules import potential_problems

if TYPE_CHECKING:
    from collections.abc import Iterator

    from mpc_cover.mission.config import AgentSpec, Area, MissionSpec

MAX_CELLS = 200_000
MAX_HORIZON_PERIODS = 2_000
_RATIO_ROUNDING = 1e-9
"""Part by which a ratio of times may be off in rounding."""


def find_problems(spec: MissionSpec, *, area_known: bool = True) -> list[Problem]:
    """Return everything that is wrong with a mission whose fields are valid one by one.

    With `area_known` false its area is a placeholder, and not validated.
    """
    shape = list(_shape_problems(spec))
    area = [*shape, *([] if shape else _area_problems(spec))] if area_known else []
    fleet = [*_agent_problems(spec), *_fleet_problems(spec), *topology_problems(spec)]
    rest = (_control_problems, planning_problems, disturbance_problems, information_problems, potential_problems)
    return [*area, *fleet, *(problem for rule in rest for problem in rule(spec))]


def _shape_problems(spec: MissionSpec) -> Iterator[Problem]:
    shape = spec.area.shape
    where = "area.shape"
    if isinstance(shape, BoxShape):
        if len(shape.min_m) != len(shape.max_m):
            yield Problem(f"{where}.max_m", shape.max_m, f"must have {len(shape.min_m)} coordinates like min_m")
        elif any(low >= high for low, high in zip(shape.min_m, shape.max_m, strict=True)):
            yield Problem(f"{where}.max_m", shape.max_m, f"must be greater than min_m {shape.min_m} on each axis")
    elif isinstance(shape, PolygonShape):
        try:
            polygon_of(shape)
        except ValueError as error:
            yield Problem(where, "polygon", str(error))


def _area_problems(spec: MissionSpec) -> Iterator[Problem]:
    area = spec.area
    lower, upper = bounding_box(area.shape)
    count = float(np.prod(np.ceil((upper - lower) / area.cell_size_m)))
    if count > MAX_CELLS:
        yield Problem("area.cell_size_m", area.cell_size_m, f"gives {count:.6g} cells, must give at most {MAX_CELLS}")
        return
    weights = list(_weight_problems(area))
    yield from weights
    if not weights and build_field(area).size == 0:
        if area.weights is not None:
            yield Problem("area.weights.values", "all 0 in the area", "must hold one greater than 0 where the area is")
        else:
            yield Problem("area.shape", area.shape.kind, "holds no cell: a larger shape or smaller cells")
    geographic = list(geographic_problems(spec))
    yield from geographic or coarse_problems(spec)
    low = area.motion_min_m or tuple(lower.tolist())
    high = area.motion_max_m or tuple(upper.tolist())
    for name, corner in (("motion_min_m", low), ("motion_max_m", high)):
        if len(corner) != len(lower):
            yield Problem(f"area.{name}", corner, f"must have {len(lower)} coordinates like the shape")
            return
    if any(a >= b for a, b in zip(low, high, strict=True)):
        yield Problem("area.motion_max_m", high, f"must be greater than motion_min_m {low} on each axis")
    for index, agent in enumerate(spec.fleet.agents):
        path = f"fleet.agents.{index}.start_m"
        if len(agent.start_m) != len(lower):
            yield Problem(path, agent.start_m, f"must have {len(lower)} coordinates like the area")
        elif any(q < a or q > b for q, a, b in zip(agent.start_m, low, high, strict=True)):
            yield Problem(path, agent.start_m, f"must lie between {low} and {high}, where agents may move")


def _weight_problems(area: Area) -> Iterator[Problem]:
    weights = area.weights
    if weights is None:
        return
    if weights.values is None:
        right = "must be given here, or in a file beside a mission file that names it in area.weights.file"
        yield Problem("area.weights.values", None, right)
    elif weights.file is not None:
        yield Problem("area.weights.file", weights.file, "and values are both given: give one of them")
    elif len({len(row) for row in weights.values}) > 1 or not weights.values[0]:
        yield Problem("area.weights.values", weights.values, "must have rows of equal length, at least one value each")


def _agent_problems(spec: MissionSpec) -> Iterator[Problem]:
    seen: dict[str, int] = {}
    measured: set[str] = set()
    for index, agent in enumerate(spec.fleet.agents):
        where = f"fleet.agents.{index}"
        if agent.id in seen:
            yield Problem(f"{where}.id", agent.id, f"is already the id of fleet.agents.{seen[agent.id]}")
        seen[agent.id] = index
        for name in ("sensing_radius_m", "speed_max_m_per_s"):
            if agent_value(spec, agent, name) is None:
                yield Problem(f"{where}.{name}", None, f"is missing: give it here or in fleet.defaults.{name}")
        yield from _input_problems(spec, agent, where)
        radius = agent_value(spec, agent, "sensing_radius_m")
        if isinstance(radius, dict):
            measured |= set(radius)
            unknown = sorted(set(radius) - set(spec.magnitudes))
            if unknown:
                right = f"unknown magnitudes {unknown}: must be among {list(spec.magnitudes)}"
                yield Problem(f"{where}.sensing_radius_m", radius, right)
        elif radius is not None:
            measured |= set(spec.magnitudes)
    yield from _magnitude_problems(spec, measured)


def _magnitude_problems(spec: MissionSpec, measured: set[str]) -> Iterator[Problem]:
    for name in sorted({name for name in spec.magnitudes if spec.magnitudes.count(name) > 1}):
        yield Problem("magnitudes", name, "is listed more than once")
    for name in dict.fromkeys(spec.magnitudes):
        if name not in measured:
            yield Problem("magnitudes", name, "is measured by no agent: give one a sensing radius for it")


def _input_problems(spec: MissionSpec, agent: AgentSpec, where: str) -> Iterator[Problem]:
    path = f"{where}.input_max_m_per_s2"
    if agent.input_max_m_per_s2 is not None and agent.force_max_n is not None:
        yield Problem(path, agent.input_max_m_per_s2, "and force_max_n are both given: give one of them")
    elif agent_input_max(spec, agent) is None:
        yield Problem(path, None, "is missing: give it, or mass_kg and force_max_n, here or in fleet.defaults")


def _fleet_problems(spec: MissionSpec) -> Iterator[Problem]:
    fleet = spec.fleet
    if len({len(agent.start_m) for agent in fleet.agents}) > 1:
        return  # already reported, agent by agent
    start = np.array([agent.start_m for agent in fleet.agents])
    reach = fleet.communication_range_m
    if reach is not None and reach <= fleet.separation_min_m:
        right = f"must be greater than separation_min_m {fleet.separation_min_m}"
        yield Problem("fleet.communication_range_m", reach, right)
    for i, j in combinations(range(len(start)), 2):
        distance = float(np.linalg.norm(start[i] - start[j]))
        if distance < fleet.separation_min_m:
            right = (
                f"is {distance:.3g} m from {fleet.agents[i].id}, "
                f"must be at least separation_min_m {fleet.separation_min_m} m"
            )
            yield Problem(f"fleet.agents.{j}.start_m", fleet.agents[j].start_m, right)
    for index in unreached(start, reach):
        right = f"is not connected to {fleet.agents[0].id} within communication_range_m {reach} m"
        yield Problem(f"fleet.agents.{index}.start_m", fleet.agents[index].start_m, right)


def _control_problems(spec: MissionSpec) -> Iterator[Problem]:
    control = spec.control
    for agent in spec.fleet.agents:
        speed = agent_value(spec, agent, "speed_max_m_per_s")
        limit = agent_input_max(spec, agent)
        if not isinstance(speed, float) or limit is None:
            continue
        braking = int(np.ceil(speed / (limit * control.plan_step) - 1e-9))
        if control.horizon_steps < braking + 2:
            right = f"must be at least {braking + 2}: {agent.id} brakes in {braking} steps"
            yield Problem("control.horizon_steps", control.horizon_steps, right)
            break
    yield from _plan_step_problems(spec)
    if control.state_period_s > control.period_s:
        right = f"must be at most period_s {control.period_s}"
        yield Problem("control.state_period_s", control.state_period_s, right)


def _plan_step_problems(spec: MissionSpec) -> Iterator[Problem]:
    """Yield what is wrong with the step of plans beside the period of control."""
    control, step_s = spec.control, spec.control.plan_step_s
    if step_s is None:
        return
    where, period = "control.plan_step_s", control.period_s
    ratio = step_s / period
    if ratio < 1.0 - _RATIO_ROUNDING:
        yield Problem(where, step_s, f"must be at least period_s {period}")
    elif abs(ratio - round(ratio)) > _RATIO_ROUNDING * ratio:
        low, high = (math.floor(ratio) * period, math.ceil(ratio) * period)
        yield Problem(where, step_s, f"must be a multiple of period_s {period}, as {low:g} or {high:g}")
    elif control.horizon_periods > MAX_HORIZON_PERIODS:
        right = f"gives a horizon of {control.horizon_periods} periods, must give at most {MAX_HORIZON_PERIODS}"
        yield Problem(where, step_s, right)
    elif control.substeps > 1:
        yield from _wide_step_problems(spec)


def _wide_step_problems(spec: MissionSpec) -> Iterator[Problem]:
    """Yield a problem if an agent flies past what it measures within a step of plans."""
    for agent in spec.fleet.agents:
        speed, given = (agent_value(spec, agent, name) for name in ("speed_max_m_per_s", "sensing_radius_m"))
        radii = [one for one in given.values() if isinstance(one, float)] if isinstance(given, dict) else [given]
        reach = min((one for one in radii if isinstance(one, float)), default=None)
        if not isinstance(speed, float) or reach is None:
            continue
        if speed * spec.control.plan_step > 2.0 * reach * (1.0 + _RATIO_ROUNDING):
            right = (
                f"{agent.id} flies {speed * spec.control.plan_step:.3g} m in it, must be at most two sensing radii, "
            )
            right += f"{2.0 * reach:.3g} m: at most {2.0 * reach / speed:.3g} s"
            yield Problem("control.plan_step_s", spec.control.plan_step_s, right)
            return
