"""The processes of a demo: a controller that may be started again, and the agents."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mpc_cover.service.run.processes import Child, end_all, free_port

if TYPE_CHECKING:
    from mpc_cover.mission.load import Mission
    from mpc_cover.service.run.demo_options import DemoOptions
    from mpc_cover.service.run.run_folder import RunFolder

CONNECT_TIMEOUT_S = 30.0
"""Several processes start at once, perhaps on a slow machine [s]."""


class Processes:
    """The controller and the agents; `observer` is the endpoint of whoever watches."""

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
            arguments += ["--connect", self._controller_at, "--record", str(self._folder.record(name))]
            arguments += ["--seed", str(self._options.seed)]
            self.agents.append(Child(name, arguments, self._folder.log(name)))

    def start_controller(self) -> None:
        """Start the controller, also once more: it goes on from its checkpoint."""
        options = self._options
        arguments = ["serve", str(self._folder.mission_file), *self._common(), "--listen", self._controller_at]
        arguments += ["--backend", options.backend, "--seed", str(options.seed)]
        arguments += ["--state-dir", str(self._folder.path / "state"), "--step-log", str(self._folder.step_log)]
        self.controller = Child("controller", arguments, self._folder.log("controller"))

    def dead_agents(self) -> list[Child]:
        """Return the agents that ended by themselves."""
        return [agent for agent in self.agents if agent.exit_status is not None]

    def end(self) -> None:
        """End all, the controller with the agents."""
        end_all([*([self.controller] if self.controller else []), *self.agents])

    def _common(self) -> list[str]:
        timeout = ["--connect-timeout", f"{CONNECT_TIMEOUT_S:g}"]
        return ["--connect", self._observer, "--speed", repr(self._options.speed), *timeout]
