"""Real processes over real Zenoh: a controller in flight is given another version of its mission."""

import json
import subprocess
import sys

import pytest
from service_fakes import small_mission, until

from mpc_cover.service.run.processes import free_port


class Processes:
    """`mpc-cover` commands in a folder, each with its own log."""

    def __init__(self, folder):
        self.folder = folder
        self._running = []

    def start(self, name, *command):
        with (self.folder / f"{name}.log").open("wb") as log:
            line = [sys.executable, "-m", "mpc_cover", *command]
            self._running.append(subprocess.Popen(line, stdout=log, stderr=log, cwd=self.folder))
        return self._running[-1]

    def said(self, name):
        return (self.folder / f"{name}.log").read_text()

    def wait_for(self, name, text):
        until(lambda: text in self.said(name) or self._running[0].poll() is not None, 60.0)
        assert text in self.said(name), self.said(name)

    def call(self, *command):
        line = [sys.executable, "-m", "mpc_cover", *command]
        return subprocess.run(line, cwd=self.folder, capture_output=True, text=True, check=False)

    def stop(self):
        for process in self._running:
            process.kill()
            process.wait()


@pytest.fixture
def processes(tmp_path):
    processes = Processes(tmp_path)
    yield processes
    processes.stop()


def write(folder, name, high, **fleet):
    """Write a mission with an area up to a height [m] in a box of 9 m."""
    raw = json.loads(small_mission().to_json())
    raw["area"]["shape"]["max_m"] = [3.0, high]
    raw["area"] |= {"motion_min_m": [0.0, 0.0], "motion_max_m": [3.0, 9.0]}
    raw["fleet"] |= fleet
    (folder / name).write_text(json.dumps(raw))


def test_a_fleet_goes_on_with_another_version_and_so_does_a_controller_that_is_started_again(processes, tmp_path):
    write(tmp_path, "old.yaml", 4.0)
    write(tmp_path, "new.yaml", 9.0)  # so much that it is not done before the controller is killed
    write(tmp_path, "other.yaml", 6.0, separation_min_m=0.4)
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    speed = ("--speed", "2")
    serve = processes.start("serve", "serve", "old.yaml", "-l", endpoint, *speed, "--stay", "--state-dir", "state")
    for name in ("a1", "a2"):
        processes.start(name, "agent", "old.yaml", "--id", name, "-e", endpoint, *speed)
    processes.wait_for("serve", "controller: flying")

    refused = processes.call("retask", "other.yaml", "-e", endpoint)
    assert (refused.returncode, refused.stdout) == (1, "")
    assert "fleet.separation_min_m: 0.4: must be 0.5, as agents know it" in refused.stderr

    accepted = processes.call("retask", "new.yaml", "-e", endpoint, "--json")
    assert accepted.returncode == 0, accepted.stderr
    assert "of 108 cells are covered already" in json.loads(accepted.stdout)["text"]
    processes.wait_for("serve", "for the same fleet: a1, a2")

    serve.kill()
    serve.wait()
    again = processes.start("again", "serve", "new.yaml", "-l", endpoint, *speed, "--state-dir", "state")
    assert again.wait(60.0) == 0, processes.said("again")
    assert "goes on from the checkpoint" in processes.said("again")
    assert "for the same fleet: a1, a2" in processes.said("again")
    assert "everything is covered and everyone is at rest" in processes.said("again")
    assert "ignores a plan" not in processes.said("a1") + processes.said("a2")
