"""The run folder that `mpc-cover serve` leaves: what was flown, as the controller knows it."""

from __future__ import annotations

import shutil
from typing import TYPE_CHECKING

from mpc_cover.service.agent.recorder import FileRecorder, Header
from mpc_cover.service.run.run_folder import RunFolder, default_folder
from mpc_cover.trajectory_file import RecordingKind
from mpc_cover.version import __version__

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from mpc_cover.mission.load import Mission
    from mpc_cover.service.controller.controller import Controller
    from mpc_cover.service.run.serve import ServeOptions


class ServedRun:
    """A run folder, written when the mission is over; without a flight it is removed, unless it was asked for.

    Parameters
    ----------
    mission, options : the mission, and `serve`'s options.
    say : called with messages for users.

    Raises
    ------
    UserError
        The folder cannot be written, or holds something that is not a run.

    Attributes
    ----------
    recorders : one of each agent, for the controller.
    """

    def __init__(self, mission: Mission, options: ServeOptions, say: Callable[[str], None]) -> None:
        self._options, self._say = options, say
        self._folder = RunFolder(options.out or default_folder(mission), RecordingKind.SERVE, mission)
        self.recorders = [
            FileRecorder(self._folder.record(name), Header(name, "", mission.spec.name, options.speed), say)
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
        meta = {"kind": RecordingKind.SERVE, "version": __version__, "speed": self._options.speed}
        meta |= {"seed": self._options.seed, "backend": self._options.backend}
        extra = {"outcome": outcome, "lost": lost, "folder": str(self._folder.path)}
        times = [step.tick_time_s for step in controller.step_log.steps if step.kind is StepKind.STEP]
        summary = write_records(controller.mission, self._folder, meta, extra, lost, step_times_of(times))
        if summary is not None:
            self._say(f"the run is in {self._folder.path}: {summary.covered_percent:.2f} % covered")
        elif self._options.out is None:
            shutil.rmtree(self._folder.path, ignore_errors=True)
        else:
            self._say(f"nothing was flown: {self._folder.path} holds no trajectory")
