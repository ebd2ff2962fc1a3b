"""The run folder that `mpc-cover serve` leaves: what was flown, as the controller knows it."""

from __future__ import annotations

import shutil
from typing import TYPE_CHECKING, Any

from mpc_cover.service.agent.recorder import FileRecorder, Header
from mpc_cover.service.run.run_folder import RunFolder
from mpc_cover.trajectory_file import RecordingKind
from mpc_cover.version import __version__

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from mpc_cover.mission.load import Mission
    from mpc_cover.service.controller.controller import Controller


class ServedRun:
    """A run folder, written when the mission is over; without a flight it is removed.

    Parameters
    ----------
    mission, path : the mission, and the folder.
    meta : written into the trajectory, beside `speed`, how many seconds of the clock pass in one of the machine's.
    say : called with messages for users.

    Raises
    ------
    UserError
        The folder cannot be written, or holds something that is not a run.

    Attributes
    ----------
    recorders : one of each agent, for the controller.
    """

    def __init__(
        self, mission: Mission, path: Path, meta: dict[str, Any], speed: float, say: Callable[[str], None]
    ) -> None:
        self._say = say
        self._meta = {"kind": RecordingKind.SERVE, "version": __version__, "speed": speed, **meta}
        self._folder = RunFolder(path, RecordingKind.SERVE, mission)
        self.recorders = [
            FileRecorder(self._folder.record(name), Header(name, "", mission.spec.name, speed), say)
            for name in mission.fleet.ids
        ]

    @property
    def step_log(self) -> Path:
        """Where the controller's step log belongs."""
        return self._folder.step_log

    def write(self, controller: Controller) -> None:
        """Write trajectory, summary and pictures of what was flown."""
        from mpc_cover.service.controller.step_log import StepKind  # noqa: PLC0415 - a second of imports, at the end
        from mpc_cover.service.run.demo import write_records  # noqa: PLC0415 - likewise
        from mpc_cover.service.run.run_folder import step_times_of  # noqa: PLC0415 - likewise

        lost, outcome = list(controller.supervisor.lost), controller.heartbeat.text
        extra = {"outcome": outcome, "lost": lost, "folder": str(self._folder.path)}
        times = [step.tick_time_s for step in controller.step_log.steps if step.kind is StepKind.STEP]
        summary = write_records(controller.mission, self._folder, self._meta, extra, lost, step_times_of(times))
        if summary is not None:
            self._say(f"the run is in {self._folder.path}: {summary.covered_percent:.2f} % covered")
        else:
            shutil.rmtree(self._folder.path, ignore_errors=True)
