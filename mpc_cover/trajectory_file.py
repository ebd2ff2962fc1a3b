"""The recording of a motion, and its file (.npz): one contract for plan, simulate, demo, check and plot."""

from __future__ import annotations

import contextlib
import io
import json
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mpc_cover.errors import InvalidInputError, Problem, UnreadableFileError, UserError
from mpc_cover.mission.load import Mission, mission_from_json
from mpc_cover.model.trajectory import Trajectory

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray


class RecordingKind(StrEnum):
    """How a recording was made: `meta["kind"]`."""

    PLAN = "plan"
    SIMULATE = "simulate"
    DEMO = "demo"
    SERVE = "serve"


@dataclass(frozen=True, eq=False, kw_only=True)
class Recording(Trajectory):
    """A fleet's motion from the start of the mission on, and what it measured.

    Attributes
    ----------
    cell : (K, d) centroids [m].
    covered_at : (K,) [s], the first sample by which every magnitude was measured; inf where never.
    agent_id : (m,) names.
    mission : the whole mission.
    meta : version, seed, back-end, kind (a `RecordingKind`) and further facts about the run; "seal" of real flights,
        see `record_seal`.
    """

    cell: FloatArray
    covered_at: FloatArray
    agent_id: tuple[str, ...]
    mission: Mission
    meta: dict[str, Any] = field(default_factory=dict)


def save_trajectory(trajectory: Recording, path: str | Path) -> None:
    """Write the `.npz`; `meta` is a JSON string that holds the whole mission under "mission".

    The same trajectory gives the same bytes: no wall-clock time is written. The file is written atomically.

    Raises
    ------
    UserError
        The file cannot be written.
    """
    meta = {**trajectory.meta, "mission": json.loads(trajectory.mission.to_json())}
    content = io.BytesIO()
    np.savez_compressed(
        content,
        time=trajectory.time,
        position=trajectory.position,
        velocity=trajectory.velocity,
        input=trajectory.input,
        cell=trajectory.cell,
        covered_at=trajectory.covered_at,
        agent_id=np.array(trajectory.agent_id, dtype=str),
        meta=np.array(json.dumps(meta, sort_keys=True, allow_nan=False)),
    )
    part = Path(f"{path}.part")
    try:
        part.write_bytes(content.getbuffer())
        part.replace(path)
    except (OSError, ValueError) as error:  # a ValueError for a name with a NUL
        with contextlib.suppress(OSError, ValueError):
            part.unlink()
        raise UserError(f"trajectory {path}: cannot be written: {getattr(error, 'strerror', None) or error}") from None


_LARGEST = 1e9
"""Beyond it nothing is a motion, and squares of it may overflow [s, m, m/s, m/s^2]."""
_ZIP = b"PK"
_FLOATS = ("time", "position", "velocity", "input", "cell", "covered_at")


def load_trajectory(path: str | Path) -> Recording:
    """Read a trajectory file.

    Raises
    ------
    UnreadableFileError
        Missing, truncated, or not a trajectory file.
    InvalidInputError
        Arrays of wrong shapes, NaN or infinite values, an unordered time; all of them at once.
    """
    what = f"trajectory {path}"
    try:
        content = Path(path).read_bytes()
    except (OSError, ValueError) as error:  # a ValueError for a name with a NUL
        raise UnreadableFileError(f"{what}: cannot be read: {getattr(error, 'strerror', None) or error}") from None
    if not content.startswith(_ZIP):
        raise UnreadableFileError(f"{what}: cannot be read: it is not an archive of arrays (.npz)")
    try:
        # the archive is in memory, so that a torn one leaves no file open
        with np.load(io.BytesIO(content), allow_pickle=False) as archive:
            data = {name: archive[name] for name in (*_FLOATS, "agent_id", "meta") if name in archive.files}
    except Exception as error:  # noqa: BLE001 - zipfile, zlib and numpy raise a dozen kinds on a torn archive
        detail = " ".join(str(error).split()) or "truncated"
        raise UnreadableFileError(f"{what}: cannot be read: {detail}") from None
    if missing := [name for name in (*_FLOATS, "agent_id", "meta") if name not in data]:
        raise UnreadableFileError(f"{what}: is not a trajectory file: lacks {', '.join(missing)}")
    return _from_arrays(data, what)


def _from_arrays(data: dict[str, Any], what: str) -> Recording:
    problems = [
        Problem(name, str(data[name].dtype), "must hold numbers")
        for name in _FLOATS
        if data[name].dtype.kind not in "fiu"
    ]
    if problems:
        raise InvalidInputError(what, problems)
    arrays: dict[str, FloatArray] = {name: np.asarray(data[name], dtype=float) for name in _FLOATS}
    try:
        meta = json.loads(str(data["meta"]))
        mission_raw = json.dumps(meta.pop("mission"))
    except (ValueError, KeyError, AttributeError, TypeError, RecursionError):
        raise UnreadableFileError(f"{what}: meta is not a JSON object with a mission") from None
    mission = mission_from_json(mission_raw, f"{what}: meta.mission")
    problems = [*_shape_problems(arrays, data, mission), *_value_problems(arrays)]
    if problems:
        raise InvalidInputError(what, problems)
    return Recording(
        arrays["time"],
        arrays["position"],
        arrays["velocity"],
        arrays["input"],
        cell=arrays["cell"],
        covered_at=arrays["covered_at"],
        agent_id=mission.fleet.ids,
        mission=mission,
        meta=meta,
    )


def _shape_problems(arrays: dict[str, FloatArray], data: dict[str, Any], mission: Mission) -> list[Problem]:
    samples = arrays["time"].size
    agents, dimension = mission.fleet.size, mission.fleet.dimension
    expected = {
        "time": (samples,),
        "position": (samples, agents, dimension),
        "velocity": (samples, agents, dimension),
        "input": (max(samples - 1, 0), agents, dimension),
        "cell": mission.field.cell.shape,
        "covered_at": (mission.field.size,),
    }
    problems = [
        Problem(f"{name}.shape", arrays[name].shape, f"must be {shape}")
        for name, shape in expected.items()
        if arrays[name].shape != shape
    ]
    if samples < 2:  # noqa: PLR2004 - one interval
        problems.append(Problem("time", arrays["time"].tolist(), "must hold at least two samples"))
    ids = tuple(str(name) for name in np.atleast_1d(data["agent_id"]))
    if ids != mission.fleet.ids:
        problems.append(Problem("agent_id", ids, f"must be the mission's {mission.fleet.ids}"))
    return problems


def _value_problems(arrays: dict[str, FloatArray]) -> list[Problem]:
    problems = []
    for name in ("time", "position", "velocity", "input", "cell"):
        bad = ~(np.abs(arrays[name]) <= _LARGEST)
        if bad.any():
            where = tuple(int(i) for i in np.argwhere(bad)[0])
            problems.append(
                Problem(f"{name}{list(where)}", float(arrays[name][where]), f"must be finite and at most {_LARGEST:g}")
            )
    covered_at = arrays["covered_at"]
    if (bad := np.isnan(covered_at) | (covered_at == -np.inf)).any():
        index = int(np.argmax(bad))
        problems.append(Problem(f"covered_at[{index}]", float(covered_at[index]), "must be a time, or inf where never"))
    time = arrays["time"]
    if time.ndim == 1 and np.isfinite(time).all() and not (step := np.diff(time) > 0).all():
        index = int(np.argmin(step)) + 1
        problems.append(Problem(f"time[{index}]", float(time[index]), "must be greater than the one before"))
    return problems
