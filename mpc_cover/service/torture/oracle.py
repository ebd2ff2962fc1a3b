"""The oracle: it sees where the agents truly are, and shares no code with what it judges.

Separation always holds, between samples as well; limits, box and unbroken motion, too. Range is asked for while
nobody is cut off. A fleet that claims that everything was covered must truly have been everywhere.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING

import msgspec
import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from mpc_cover.arrays import BoolArray, FloatArray
    from mpc_cover.mission.load import Mission
    from mpc_cover.service.agent.recorder import Piece

STEP_S = 0.01
"""Step at which true positions are looked at [s]; between two of them motion is taken for straight, which leaves out
a step squared times the acceleration over four: 0.04 mm at 1.5 m/s^2."""
_TOLERANCE = 1e-3
"""Of separation and range, relative to them; a plain choice above what the step leaves out."""
_LIMIT_TOLERANCE = 1e-5
"""Of speed, input and box, relative to the limits and to the sensing radius; a plain choice."""


class Violation(msgspec.Struct, frozen=True):
    """Something that must not happen: what, when in virtual time [s], of whom, how much where how much is asked."""

    what: str
    time_s: float
    agents: tuple[str, ...] = ()
    value: float = 0.0
    limit: float = 0.0
    text: str = ""

    @property
    def line(self) -> str:
        """The violation in a line, for people."""
        numbers = f" {self.value:.4g} where {self.limit:.4g} is asked" if self.limit else ""
        return f"{self.what}{numbers}, {' and '.join(self.agents)} at {self.time_s:.2f} s {self.text}".rstrip()


@dataclass(frozen=True, eq=False)
class Track:
    """The true motion of one agent: states (K, d) [m], [m/s] at times (K,) [s], and the inputs held from there on."""

    time: FloatArray
    position: FloatArray
    velocity: FloatArray
    input: FloatArray

    @classmethod
    def of(cls, pieces: Sequence[Piece]) -> Track:
        """Return the track of a record."""
        columns = (np.array([getattr(p, name) for p in pieces], dtype=float) for name in _COLUMNS)
        return cls(*columns)

    def at(self, time: FloatArray) -> FloatArray:
        """Return the positions (T, d) [m] at times (T,) [s]."""
        row = np.clip(np.searchsorted(self.time, time, side="right") - 1, 0, None)
        dt = np.maximum(time - self.time[row], 0.0)[:, None]
        return np.asarray(self.position[row] + dt * self.velocity[row] + 0.5 * dt**2 * self.input[row])


_COLUMNS = ("time_s", "position", "velocity", "input")


@dataclass(frozen=True, eq=False)
class Sight:
    """What the oracle saw.

    Attributes
    ----------
    violations : the first of each kind for each pair or agent.
    smallest_m : the smallest distance between two agents [m].
    """

    violations: tuple[Violation, ...]
    smallest_m: float


def judge(
    mission: Mission,
    motions: Mapping[str, Sequence[Piece]],
    end_s: float,
    *,
    apart: Sequence[tuple[float, float]],
    claimed: BoolArray | None,
) -> Sight:
    """Judge what the agents truly flew until `end_s` of the virtual time.

    Parameters
    ----------
    motions : the true motion of each agent.
    apart : spans of time [s] in which somebody may be out of range.
    claimed : (K,) which cells the controller claims to have covered in the end; None where nothing is claimed.
    """
    tracks = {name: Track.of(motions[name]) for name in mission.fleet.ids}
    time = np.append(np.arange(max(float(track.time[0]) for track in tracks.values()), end_s, STEP_S), end_s)
    position = np.stack([tracks[name].at(time) for name in mission.fleet.ids], axis=1)
    smallest, close = _separation(mission, time, position)
    found = [*close, *_connectivity(mission, time, position, apart), *_limits(mission, tracks)]
    if claimed is not None:
        found += _claims(mission, position, claimed)
    return Sight(tuple(sorted(found, key=lambda violation: violation.time_s)), smallest)


def _separation(mission: Mission, time: FloatArray, position: FloatArray) -> tuple[float, list[Violation]]:
    asked = mission.fleet.separation_min
    found, smallest = [], np.inf
    for i, j in combinations(range(mission.fleet.size), 2):
        apart = position[:, i] - position[:, j]
        step = np.diff(apart, axis=0)
        length = (step**2).sum(axis=1)
        share = np.clip(-(apart[:-1] * step).sum(axis=1) / np.where(length > 0.0, length, 1.0), 0.0, 1.0)
        nearest = np.sqrt(((apart[:-1] + share[:, None] * step) ** 2).sum(axis=1))
        smallest = min(smallest, float(nearest.min(initial=np.inf)))
        if (too_near := nearest < asked * (1.0 - _TOLERANCE)).any():
            row = int(np.argmin(nearest))
            names = mission.fleet.ids[i], mission.fleet.ids[j]
            first = float(time[int(np.argmax(too_near))])
            found.append(Violation("separation", first, names, float(nearest[row]), asked))
    return smallest, found


def _connectivity(
    mission: Mission, time: FloatArray, position: FloatArray, apart: Sequence[tuple[float, float]]
) -> Iterator[Violation]:
    asked = mission.fleet.communication_range
    if not np.isfinite(asked):
        return
    judged = np.ones(len(time), dtype=bool)
    for begin_s, end_s in apart:
        judged &= (time < begin_s) | (time > end_s)
    if not judged.any():
        return
    distance = np.linalg.norm(position[:, :, None] - position[:, None], axis=-1)
    needed = _needed_range(distance)
    broken = judged & (needed > asked * (1.0 + _TOLERANCE))
    if broken.any():
        row = int(np.argmax(broken))
        worst = float(needed[judged].max())
        yield Violation("connectivity", float(time[row]), (), worst, asked, f"for {STEP_S * broken.sum():.2f} s")


def _needed_range(distance: FloatArray) -> FloatArray:
    """Return the range (T,) [m] with which the fleet is connected: the longest edge of its minimum spanning tree."""
    steps, size, _ = distance.shape
    rows = np.arange(steps)
    nearest, joined = distance[:, 0].copy(), np.zeros((steps, size), dtype=bool)
    joined[:, 0] = True
    longest = np.zeros(steps)
    for _ in range(size - 1):
        following = np.argmin(np.where(joined, np.inf, nearest), axis=1)
        longest = np.maximum(longest, nearest[rows, following])
        joined[rows, following] = True
        nearest = np.minimum(nearest, distance[rows, following])
    return longest


def _limits(mission: Mission, tracks: Mapping[str, Track]) -> Iterator[Violation]:
    fleet, length = mission.fleet, mission.fleet.sensing_radius_min
    for index, (name, track) in enumerate(tracks.items()):
        for what, values, limit in (
            ("speed", track.velocity, float(fleet.speed_max[index])),
            ("input", track.input, float(fleet.input_max[index])),
        ):
            size = np.linalg.norm(values, axis=1)
            if (size > limit * (1.0 + _LIMIT_TOLERANCE)).any():
                row = int(np.argmax(size))
                yield Violation(what, float(track.time[row]), (name,), float(size[row]), limit)
        out = np.maximum(fleet.motion_min - track.position, track.position - fleet.motion_max).max(axis=1)
        if (out > _LIMIT_TOLERANCE * length).any():
            row = int(np.argmax(out))
            yield Violation("box", float(track.time[row]), (name,), float(out[row]), 0.0, f"{out[row]:.3g} m outside")
        dt = np.diff(track.time)[:, None]
        reached = track.position[:-1] + dt * track.velocity[:-1] + 0.5 * dt**2 * track.input[:-1]
        jump = np.linalg.norm(track.position[1:] - reached, axis=1)
        if (jump > _LIMIT_TOLERANCE * length).any():
            row = int(np.argmax(jump))
            yield Violation("jump", float(track.time[row + 1]), (name,), float(jump[row]), 0.0, f"{jump[row]:.3g} m")


def _claims(mission: Mission, position: FloatArray, claimed: BoolArray) -> Iterator[Violation]:
    """Cells that nobody was ever near enough to measure."""
    radius = mission.fleet.radius.max(axis=1)
    true = np.zeros(mission.field.size, dtype=bool)
    for agent in range(mission.fleet.size):
        for block in np.array_split(position[:, agent], max(1, len(position) // 500)):
            away = np.linalg.norm(mission.field.cell[:, None] - block[None], axis=-1).min(axis=1)
            true |= away <= radius[agent] * (1.0 + _TOLERANCE)
    false = int((claimed & ~true).sum())
    if false:
        yield Violation("claim", 0.0, (), 0.0, 0.0, f"{false} of {claimed.sum()} claimed cells were never measured")
