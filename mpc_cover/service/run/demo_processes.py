"""The processes of a demo: a controller that can be restarted, and the agents; with their options."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from mpc_cover.service.credentials.roles import CONTROLLER
from mpc_cover.service.run.processes import Child, free_port, terminate_all

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from mpc_cover.mission.load import Mission
    from mpc_cover.service.run.run_folder import RunFolder

CONNECT_TIMEOUT_S = 30.0
"""Several processes start at once, perhaps on a slow machine [s]."""


@dataclass(frozen=True)
class DemoOptions:
    """See `mpc-cover demo --help`.

    `deaths` are the mission times [s] at which agents are killed, by id; `credentials` is the folder of a whole fleet.
    """

    backend: str = "native"
    seed: int = 0
    speed: float = 1.0
    deaths: Mapping[str, float] = field(default_factory=dict)
    credentials: Path | None = None

    def of_role(self, role: str) -> list[str]:
        """Return the option that gives a process the credentials of its role."""
        return ["--credentials", str(self.credentials.absolute() / role)] if self.credentials is not None else []


class Processes:
    """The controller and the agents; `observer` is the endpoint of the demo's observer.

    Agents and observer are connected with the controller; with credentials all are connected with the observer, which
    passes on what each of them may say.
    """

    def __init__(self, mission: Mission, options: DemoOptions, folder: RunFolder, observer: str) -> None:
        self._options, self._folder, self._observer = options, folder, observer
        self._controller_at = f"tcp/127.0.0.1:{free_port([int(observer.rsplit(':', 1)[1])])}"
        self._ids = mission.fleet.ids
        self.restarts = 0
        self.controller: Child | None = None
        self.agents: list[Child] = []

    def start(self) -> None:
        """Start all."""
        self.start_controller()
        for name in self._ids:
            arguments = ["agent", str(self._folder.mission_file), "--id", name, *self._common()]
            arguments += ["--record", str(self._folder.record(name)), *self._options.of_role(name)]
            if self._options.credentials is None:
                arguments += ["--connect", self._controller_at]
            arguments += ["--seed", str(self._options.seed)]
            self.agents.append(Child(name, arguments, self._folder.log(name)))

    def start_controller(self) -> None:
        """Start the controller, the first time or again: then it resumes from its checkpoint."""
        options = self._options
        arguments = ["serve", str(self._folder.mission_file), *self._common(), *options.of_role(CONTROLLER)]
        if options.credentials is None:
            arguments += ["--listen", self._controller_at]
        arguments += ["--backend", options.backend, "--seed", str(options.seed)]
        arguments += ["--state-dir", str(self._folder.path / "state"), "--step-log", str(self._folder.step_log)]
        self.controller = Child("controller", arguments, self._folder.log("controller"))

    def dead_agents(self) -> list[Child]:
        """Return the agents whose processes have ended."""
        return [agent for agent in self.agents if agent.exit_status is not None]

    def end(self) -> None:
        """End the controller and the agents."""
        terminate_all([*([self.controller] if self.controller else []), *self.agents])

    def _common(self) -> list[str]:
        timeout = ["--connect-timeout", f"{CONNECT_TIMEOUT_S:g}"]
        return ["--connect", self._observer, "--speed", repr(self._options.speed), *timeout]
