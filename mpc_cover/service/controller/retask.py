"""Retasks a fleet in flight with another version of its mission: what may change, and what of the map stays valid.

Agents are not restarted: their limits and the box that they stay in are those of the mission that they were started
with. So the area within that box, what counts as measured, and the controller's times may change; the fleet may not.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy

from mpc_cover.errors import InvalidInputError, Problem, UserError
from mpc_cover.information.build import make_map, true_field
from mpc_cover.information.flight_map import FlightMap
from mpc_cover.mission.fleet import agent_input_max, agent_radii, agent_value
from mpc_cover.mission.information import (
    AgeingInformation,
    EffectiveInformation,
    InformationKind,
    KalmanInformation,
)
from mpc_cover.mission.load import mission_from_json
from mpc_cover.service.controller.commands import Decision

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

    from mpc_cover.arrays import FloatArray, IntArray
    from mpc_cover.control.control_law import ControlLaw
    from mpc_cover.information.demand import FlownMap
    from mpc_cover.information.residual_map import ResidualMap
    from mpc_cover.mission.config import AgentSpec, MissionSpec
    from mpc_cover.mission.field import Field
    from mpc_cover.mission.load import Mission

CENTROID_TOLERANCE = 1e-6
"""Centroids nearer than this part of a cell's edge are the same."""
_MAY_CHANGE = {
    "control": {"time_limit_s", "planning_time_s"},
    "disturbance": set[str](),
    "fleet": {"agents", "defaults"},
}
"""By section, what may change or is compared agent by agent; all else in it must stay."""
_STAYS = "as agents know it: to change it, start serve and its agents anew"


@dataclass(frozen=True, eq=False)
class Retask:
    """The mission to continue with, a law for it, and a map with what is known from before."""

    mission: Mission
    law: ControlLaw
    coverage: FlownMap


def consider_retask(
    text: str, current: Mission, coverage: FlownMap, time_s: float, law_for: Callable[[Mission], ControlLaw]
) -> tuple[Retask | None, Decision]:
    """Return what a controller needs to continue with another version of its mission, or None; and the reply.

    Parameters
    ----------
    text : the other version, as JSON.
    current, coverage, time_s : the mission that is flown, its map, and the mission time [s].
    law_for : returns a control law for a mission.
    """
    try:
        mission = retasked(text, current, time_s)
        if mission.to_json() == current.to_json():
            return None, Decision(text="that is the mission which is flown already")
        law = law_for(mission)
        known = make_map(mission)
        known.restore(carry_over(current, coverage.state(), mission, time_s))
    except InvalidInputError as error:
        return None, Decision(accepted=False, text="refused", problems=tuple(map(str, error.problems)))
    except UserError as error:
        return None, Decision(accepted=False, text=f"refused: {error}")
    except Exception as error:  # noqa: BLE001 - a mission that cannot be planned must not end the current one
        return None, Decision(accepted=False, text=f"refused: {error!r}")
    covered, cells = known.covered_count, known.cell_count
    text = f"{covered} of {cells} cells are covered already; everyone comes to rest, and the rest is planned for"
    return Retask(mission, law, known), Decision(text=text)


def retasked(text: str, current: Mission, time_s: float) -> Mission:
    """Return the other version of a mission that is flown, at `time_s` [s] of it.

    Raises
    ------
    UnreadableFileError
        It is no JSON.
    InvalidInputError
        It has mistakes, or is for another fleet.
    """
    mission = mission_from_json(text, "the mission")
    if problems := list(retask_problems(current, mission, time_s)):
        raise InvalidInputError("the mission", problems)
    return mission


def retask_problems(current: Mission, other: Mission, time_s: float) -> Iterator[Problem]:
    """Yield why a fleet that flies one version of a mission, at `time_s` [s] of it, cannot fly another."""
    old, new = current.spec, other.spec
    if new.name != old.name:
        yield Problem("name", new.name, f"must be {old.name}, the mission that this controller flies")
    if other.fleet.ids != current.fleet.ids:
        yield Problem("fleet.agents", list(other.fleet.ids), f"must be {list(current.fleet.ids)}, {_STAYS}")
    elif other.fleet.dimension != current.fleet.dimension:
        yield Problem("area.shape", new.area.shape.kind, f"must have {current.fleet.dimension} dimensions")
    else:
        for index, agents in enumerate(zip(old.fleet.agents, new.fleet.agents, strict=True)):
            yield from _limit_problems(old, new, agents, f"fleet.agents.{index}")
        yield from _box_problems(current, other)
    if new.magnitudes != old.magnitudes:
        yield Problem("magnitudes", list(new.magnitudes), f"must be {list(old.magnitudes)}, {_STAYS}")
    for section, free in _MAY_CHANGE.items():
        before, after = getattr(old, section), getattr(new, section)
        for name in type(before).model_fields:
            was, value = getattr(before, name), getattr(after, name)
            if name not in free and value != was:
                yield Problem(f"{section}.{name}", value, f"must be {was}, {_STAYS}")
    if new.control.time_limit_s <= time_s:
        right = f"must be greater than the mission time, which goes on: {time_s:.1f} s"
        yield Problem("control.time_limit_s", new.control.time_limit_s, right)


def _limit_problems(
    old: MissionSpec, new: MissionSpec, agents: tuple[AgentSpec, AgentSpec], where: str
) -> Iterator[Problem]:
    """Compare an agent's limits, however they are written."""
    before, after = agents
    values = {
        "speed_max_m_per_s": (
            agent_value(old, before, "speed_max_m_per_s"),
            agent_value(new, after, "speed_max_m_per_s"),
        ),
        "input_max_m_per_s2": (agent_input_max(old, before), agent_input_max(new, after)),
        "sensing_radius_m": (agent_radii(old, before).tolist(), agent_radii(new, after).tolist()),
    }
    for name, (was, value) in values.items():
        if value != was:
            yield Problem(f"{where}.{name}", value, f"must be {was}, {_STAYS}")


def _box_problems(current: Mission, other: Mission) -> Iterator[Problem]:
    """Compare the boxes: agents reject plans that leave the box of the mission that they were started with."""
    why = "the box that agents stay in may shrink, not grow; left out, it is the area's bounding box"
    low, high = current.fleet.motion_min, current.fleet.motion_max
    if (other.fleet.motion_min < low).any():
        yield Problem("area.motion_min_m", other.fleet.motion_min.tolist(), f"must be at least {low.tolist()}: {why}")
    if (other.fleet.motion_max > high).any():
        yield Problem("area.motion_max_m", other.fleet.motion_max.tolist(), f"must be at most {high.tolist()}: {why}")


def carry_over(old: Mission, state: Mapping[str, FloatArray], new: Mission, time_s: float) -> dict[str, FloatArray]:
    """Return the state of a map for `new` that knows what a map for `old` knew of the cells that both have.

    Cells with the same centroid are the same, whatever their size and weight. Only maps whose looks mean the same
    are carried over; the number of looks, level, variance or age at which a cell is settled may differ.

    Parameters
    ----------
    old, state : a mission, and what `FlownMap.state` of its map returned.
    new : the other version of it.
    time_s : mission time [s], at which cells become settled of which less is asked now.
    """
    fresh = make_map(new)
    kept = _begun_at(fresh.state(), time_s)
    before, here = _known_cells(old, new)
    if here.size:
        for name in kept.keys() - {"recent", "clock"}:
            kept[name][:, here] = state[name][:, before]
        if "recent" in kept:
            kept["recent"] = _renumbered(state["recent"], before, here, old.field.size, new.field.size)
        if "clock" in kept:
            kept["clock"] = state["clock"].copy()
    fresh.restore(kept)
    if isinstance(fresh, FlightMap):
        _settle(fresh.map, time_s)
    return fresh.state()


def _begun_at(state: dict[str, FloatArray], time_s: float) -> dict[str, FloatArray]:
    """Let a patrol begin at a mission time [s]; other maps have no start time."""
    if "clock" in state:
        state["last"][:] = time_s
        state["clock"] = np.array([time_s, time_s, 0.0])
    return state


def _known_cells(old: Mission, new: Mission) -> tuple[IntArray, IntArray]:
    """Return (n,), (n,): the numbers in each mission of the cells that both have, if their looks mean the same."""
    before, here = _same_cells(old.field, new.field)
    if _meaning(old.spec) != _meaning(new.spec):
        return before[:0], here[:0]
    if isinstance(new.spec.information, KalmanInformation):  # simulated fields are stretched over the area
        same = np.isclose(true_field(old)[:, before], true_field(new)[:, here]).all(axis=0)
        return before[same], here[same]
    return before, here


def _same_cells(old: Field, new: Field) -> tuple[IntArray, IntArray]:
    near = CENTROID_TOLERANCE * min(old.cell_size, new.cell_size)
    distance, nearest = scipy.spatial.cKDTree(old.cell).query(new.cell, distance_upper_bound=near)
    here = np.flatnonzero(np.isfinite(distance))
    return np.asarray(nearest)[here], here


def _meaning(spec: MissionSpec) -> tuple[object, ...]:
    """Return what determines the information that a look adds, without how much of it is asked for."""
    match spec.information:
        case EffectiveInformation() as given:
            return given.kind, given.peak, given.least
        case KalmanInformation() as given:
            return given.kind, given.noise_variance, given.prior_variance, given.prior_mean, given.field
        case AgeingInformation() as given:
            return (given.kind,)
    return (InformationKind.LOOKS if spec.looks_again else InformationKind.COVERAGE,)


def _renumbered(recent: FloatArray, before: IntArray, here: IntArray, cells: int, others: int) -> FloatArray:
    """Return (3, n) recent looks with their (magnitude, cell) places renumbered for a map with other cells."""
    number = np.full(cells, -1, dtype=np.intp)
    number[before] = here
    row, cell = np.divmod(recent[1].astype(np.intp), cells)
    known = number[cell] >= 0
    found = recent[:, known].copy()
    found[1] = row[known] * others + number[cell[known]]
    return found


def _settle(inner: ResidualMap, time_s: float) -> None:
    """Recompute when places were settled: never where they are owed again, now [s] where they are not any more."""
    owed = inner.residual > 0.0
    inner.done_at[owed] = np.inf
    inner.done_at[~owed & np.isinf(inner.done_at)] = time_s
