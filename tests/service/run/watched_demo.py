"""A `mpc-cover demo` in a process of its own, under watch."""

import json
import re
import subprocess
import sys
from pathlib import Path

from service_fakes import until

from mpc_cover.trajectory_file import load_trajectory
from mpc_cover.verification.check import check_trajectory


class Demo:
    """A `mpc-cover demo` under watch."""

    def __init__(self, tmp_path, mission, *options):
        self.folder = tmp_path / "run"
        mission_file = tmp_path / "mission.yaml"
        mission_file.write_text(mission.to_json())
        self._out, self._err = tmp_path / "out", tmp_path / "err"
        command = [sys.executable, "-m", "mpc_cover", "demo", str(mission_file), "--out", str(self.folder), "--json"]
        with self._out.open("wb") as out, self._err.open("wb") as err:
            self.process = subprocess.Popen([*command, *options], stdout=out, stderr=err, cwd=tmp_path)

    @property
    def said(self) -> str:
        return self._err.read_text()

    def wait_for(self, text: str) -> None:
        until(lambda: text in self.said or self.process.poll() is not None, 60.0)
        assert text in self.said, self.said

    def pids(self) -> dict[str, int]:
        self.wait_for("processes: ")
        line = next(line for line in self.said.splitlines() if line.startswith("processes: "))
        pids = {name: int(pid) for name, pid in re.findall(r"(\w+) (\d+)", line)}
        if again := re.findall(r"started again \((\d+)\)", self.said):
            pids["controller"] = int(again[-1])
        return pids

    def end(self, status: int) -> dict:
        """Wait for the end, all children's too; return the summary printed."""
        assert self.process.wait(60.0) == status, self.said
        until(lambda: not any(alive(pid) for pid in self.pids().values()))
        return json.loads(self._out.read_text())

    def stop(self) -> None:
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait()


def alive(pid: int) -> bool:
    try:
        return "State:\tZ" not in Path(f"/proc/{pid}/status").read_text()
    except (FileNotFoundError, ProcessLookupError):
        return False


def holds(folder) -> bool:
    return check_trajectory(load_trajectory(folder / "trajectory.npz")).holds
