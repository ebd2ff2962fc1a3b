"""The folder with the results of a run."""

from __future__ import annotations

import json
import shutil
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mpc_cover.errors import UnreadableFileError, UserError
from mpc_cover.output import output_path

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mpc_cover.arrays import FloatArray
    from mpc_cover.mission.load import Mission
    from mpc_cover.trajectory_file import Recording, RecordingKind
    from mpc_cover.verification.report import Report
    from mpc_cover.verification.summary import RunSummary

MARKER = "run.json"
"""A folder with this file is a run folder; others are never cleared."""


class RunFolder:
    """Creates a run folder, and writes its files; what an earlier run left in it is removed, see `run_path`.

    Raises
    ------
    UserError
        The folder cannot be written, or holds something that is not a run.
    """

    def __init__(self, path: Path, kind: RecordingKind, mission: Mission) -> None:
        self.path = path
        try:
            path.mkdir(parents=True, exist_ok=True)
            if any(path.iterdir()):
                self._clear()
            for name in ("agents", "logs"):
                (path / name).mkdir()
            (path / MARKER).write_text(
                json.dumps({"kind": kind, "mission": mission.spec.name}) + "\n", encoding="utf-8"
            )
            self.mission_file.write_text(mission.to_json() + "\n", encoding="utf-8")
        except OSError as error:
            raise UserError(f"run folder {path}: cannot be written: {error.strerror or error}") from None

    @property
    def mission_file(self) -> Path:
        """The mission as it was flown."""
        return self.path / "mission.json"

    @property
    def step_log(self) -> Path:
        """The controller's step log."""
        return self.path / "steps.jsonl"

    def record(self, agent: str) -> Path:
        """Return the file of an agent's own record."""
        return self.path / "agents" / f"{agent}.jsonl"

    def log(self, name: str) -> Path:
        """Return the log file of a process."""
        return self.path / "logs" / f"{name}.log"

    def write(self, trajectory: Recording, step_times: FloatArray, extra: dict[str, Any]) -> RunSummary:
        """Write trajectory, step times, summary and figures; return the summary.

        `step_times` is (S,) [s]; `extra` is written into summary.json.
        """
        from mpc_cover.trajectory_file import save_trajectory  # noqa: PLC0415 - children start faster without it
        from mpc_cover.verification.check import check_trajectory  # noqa: PLC0415 - likewise
        from mpc_cover.verification.summary import summarise  # noqa: PLC0415 - likewise

        try:
            save_trajectory(trajectory, self.path / "trajectory.npz")
            np.savez_compressed(self.path / "step_times.npz", step_time=step_times)
            report = check_trajectory(trajectory)
            summary = summarise(trajectory, report, step_times)
            self.write_summary({**summary.to_dict(), **extra, "verification": report.to_dict()})
            self._draw(trajectory, step_times, report)
        except OSError as error:
            raise UserError(f"run folder {self.path}: cannot be written: {error.strerror or error}") from None
        return summary

    def write_summary(self, summary: dict[str, Any]) -> None:
        """Write summary.json."""
        text = json.dumps(summary, indent=2, allow_nan=False)
        (self.path / "summary.json").write_text(text + "\n", encoding="utf-8")

    def _draw(self, trajectory: Recording, step_times: FloatArray, report: Report) -> None:
        from mpc_cover.view.figures import draw_run  # noqa: PLC0415 - a second of matplotlib

        draw_run(trajectory, self.path, step_times, report)

    def _clear(self) -> None:
        if not (self.path / MARKER).is_file():
            raise UserError(f"run folder {self.path}: is not empty and not a run of mpc-cover: give another --out")
        for name in ("agents", "logs", "state"):
            shutil.rmtree(self.path / name, ignore_errors=True)
        for pattern in ("*.png", "*.npz", "*.json", "*.jsonl"):
            for file in self.path.glob(pattern):
                file.unlink()


def run_path(given: Path | None, mission: Mission, *, overwrite: bool = False) -> Path:
    """Return the path of a new run: as given, or runs/<mission>-<local time>, which does not exist yet.

    Raises
    ------
    UserError
        A flight is there already, and is not to be overwritten.
    """
    default = Path("runs") / f"{mission.spec.name}-{time.strftime('%Y%m%d-%H%M%S')}"
    return output_path(given, default, flown_in, overwrite=overwrite)


def flown_in(folder: Path) -> Path | None:
    """Return the file in a run folder that tells of a flight: its trajectory, or an agent's record of some motion."""
    records = (file for file in sorted(folder.glob("agents/*.jsonl")) if file.read_bytes().count(b"\n") > 1)
    trajectory = folder / "trajectory.npz"
    return trajectory if trajectory.is_file() else next(records, None)


def read_step_times(folder: Path) -> FloatArray | None:
    """Return the (S,) [s] step times of a run, or None when it has none.

    Raises
    ------
    UnreadableFileError
        The file is there but damaged.
    """
    file = folder / "step_times.npz"
    if not file.is_file():
        return None
    try:
        with np.load(file, allow_pickle=False) as archive:
            times = np.asarray(archive["step_time"], dtype=float)
    except Exception as error:  # noqa: BLE001 - whatever a torn archive raises
        raise UnreadableFileError(f"step times {file}: cannot be read: {error}") from None
    if times.ndim != 1 or not np.isfinite(times).all():
        raise UnreadableFileError(f"step times {file}: must be a row of finite numbers")
    return times


def find_trajectory(path: Path) -> Path:
    """Return the path of a trajectory file: the given one, or that in a run folder."""
    return path / "trajectory.npz" if path.is_dir() else path


def step_times_of(times: Sequence[float]) -> FloatArray:
    """Return (S,) [s]."""
    return np.array(times, dtype=float)
