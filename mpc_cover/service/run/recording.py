"""Merges the agents' own records into one recording: of what was flown, not what was planned."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mpc_cover.errors import UnreadableFileError
from mpc_cover.information.replay import measured_at
from mpc_cover.service.agent.recorded_motion import lasting, motion_of, rests_from
from mpc_cover.service.agent.recorder import MemoryRecorder
from mpc_cover.service.agent.schedule import Plant, Schedule
from mpc_cover.trajectory_file import Recording

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    from mpc_cover.arrays import FloatArray
    from mpc_cover.mission.load import Mission
    from mpc_cover.model.trajectory import Trajectory
    from mpc_cover.service.agent.recorder import Piece

MERGE_S = 1e-7
"""Breakpoints of different agents nearer than this become one sample [s]."""


def extended(pieces: Sequence[Piece], input_max: float, until_s: float) -> list[Piece]:
    """Return the record of an agent whose process died, extended to `until_s` [s].

    The extension is what its deadman does: it brakes with full input [m/s^2] from the last recorded state, and stays
    where it comes to rest.
    """
    last, rest = pieces[-1], MemoryRecorder()
    plant = Plant(last.time_s, np.array(last.position), np.array(last.velocity), rest.piece)
    plant.advance(until_s, Schedule(input_max))
    rest.mark(plant.time_s, plant.position, plant.velocity)
    return [*pieces, *rest.pieces]


def merge(
    mission: Mission, records: Sequence[Sequence[Piece]], meta: dict[str, Any], died: Collection[str] = ()
) -> Recording:
    """Return the fleet's recording from the agents' records, in the order of the mission's agents.

    All records are of one clock. Time 0 is the start of the first plan that was flown; the recording ends when
    all agents are at rest for good, or, where agents at rest keep measuring, with the record that ends first. A flight
    that ended as it began, with everything within range, is a state period of rest. Records of agents that `died`
    are `extended`, and measure nothing there; the times of their deaths are in the recording's meta as "lost" [s], by
    id.

    Raises
    ------
    UnreadableFileError
        An agent has no record, or the records have no time in common.
    """
    lacking = [name for name, pieces in zip(mission.fleet.ids, records, strict=True) if len(pieces) < 2]  # noqa: PLR2004
    if lacking:
        raise UnreadableFileError(f"no motion was recorded of {', '.join(lacking)}")
    whole, ends = _extended(mission, records, died)
    motions = [motion_of(pieces) for pieces in whole]
    flown = [piece.time_s for pieces in whole if (piece := _first_flown(pieces))]
    first, last = _span(motions, flown, to_the_end=mission.spec.looks_again)
    brief = last - first <= MERGE_S
    if brief and (last < first - MERGE_S or any(motion.velocity.any() for motion in motions)):
        raise UnreadableFileError("the agents' records have no time in common")
    if brief:
        last = first + mission.spec.control.state_period_s
        limits = mission.fleet.input_max.tolist()
        motions = [motion_of(extended(pieces, limit, last)) for pieces, limit in zip(whole, limits, strict=True)]
    time = _instants(motions, first, last)
    states = [motion.at(time, 0.0) for motion in motions]
    middle = 0.5 * (time[:-1] + time[1:])
    position, velocity = (np.stack(part, axis=1) for part in zip(*states, strict=True))
    return Recording(
        time=time - first,
        position=position,
        velocity=velocity,
        input=np.stack([motion.input_at(middle, 0.0) for motion in motions], axis=1),
        cell=mission.field.cell,
        covered_at=measured_at(mission, time - first, _measuring(mission, time, position, ends), velocity),
        agent_id=mission.fleet.ids,
        mission=mission,
        meta={**meta, "lost": {name: end_s - first for name, end_s in ends.items()}} if ends else meta,
    )


def _extended(
    mission: Mission, records: Sequence[Sequence[Piece]], died: Collection[str]
) -> tuple[list[Sequence[Piece]], dict[str, float]]:
    """Return records that last as long as those of the agents that did not die, and the times of deaths [s], by id."""
    ends = {name: pieces[-1].time_s for name, pieces in zip(mission.fleet.ids, records, strict=True)}
    until_s = min((end_s for name, end_s in ends.items() if name not in died), default=max(ends.values()))
    whole = [
        extended(pieces, float(limit), until_s) if name in died else pieces
        for name, limit, pieces in zip(mission.fleet.ids, mission.fleet.input_max, records, strict=True)
    ]
    return whole, {name: end_s for name, end_s in ends.items() if name in died}


def _measuring(mission: Mission, time: FloatArray, position: FloatArray, ends: dict[str, float]) -> FloatArray:
    """Return positions (T, m, d) [m] with NaN for the dead after their ends [s], by id.

    Whoever died before the record begins had measured where it stands.
    """
    measuring = position.copy()
    for name, end_s in ends.items():
        measuring[time > max(end_s, float(time[0])) + MERGE_S, mission.fleet.ids.index(name)] = np.nan
    return measuring


def _first_flown(pieces: Sequence[Piece]) -> Piece | None:
    """Return the piece at which an agent started its first plan; None where it never did."""
    return next((piece for piece in lasting(pieces) if piece.plan is not None), None)


def _span(motions: Sequence[Trajectory], flown: Sequence[float], *, to_the_end: bool) -> tuple[float, float]:
    """Return when the flight began, and when all agents had come to rest for good, or the records end [s].

    `flown` is when each agent started its first plan [s].
    """
    common = max(float(motion.time[0]) for motion in motions), min(float(motion.time[-1]) for motion in motions)
    first = max(common[0], min(flown, default=common[0]))
    rest = max(rests_from(motion) for motion in motions)
    return first, common[1] if to_the_end or rest <= first else min(common[1], rest)


def _instants(motions: Sequence[Trajectory], first: float, last: float) -> FloatArray:
    """Return all agents' breakpoints between first and last (T,) [s], both included."""
    inner = np.unique(np.concatenate([motion.time for motion in motions]))
    inner = inner[(inner > first + MERGE_S) & (inner < last - MERGE_S)]
    if inner.size:
        inner = inner[np.append(True, np.diff(inner) > MERGE_S)]
    return np.concatenate([[first], inner, [last]])
