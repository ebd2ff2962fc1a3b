"""`serve` leaves a run that `check` and `plot` read, and agents tell that the mission is complete."""

import os
import subprocess
import sys

from service_fakes import small_mission, until

from mpc_cover.service.run.processes import free_port
from mpc_cover.service.run.run_folder import find_trajectory, flown_in
from mpc_cover.trajectory_file import load_trajectory
from mpc_cover.verification.check import check_trajectory


def test_a_served_mission_leaves_a_run_and_everyone_says_that_it_is_complete(tmp_path):
    (tmp_path / "mission.yaml").write_text(small_mission().to_json())
    endpoint, processes = f"tcp/127.0.0.1:{free_port()}", []

    def start(name, *arguments):
        with (tmp_path / f"{name}.log").open("wb") as out:
            command = [sys.executable, "-m", "mpc_cover", *arguments, "--speed", "4"]
            processes.append(subprocess.Popen(command, cwd=tmp_path, stdout=out, stderr=out, env=dict(os.environ)))
        return processes[-1]

    try:
        serve = start("serve", "serve", "mission.yaml", "-l", endpoint, "--out", "flown", "--stay")
        for name in ("a1", "a2"):
            start(name, "agent", "mission.yaml", "--id", name, "-e", endpoint)
        for name in ("a1", "a2"):
            until(
                lambda n=name: "the mission is complete: everything is covered" in (tmp_path / f"{n}.log").read_text()
            )
        until(lambda: "complete: " in (tmp_path / "serve.log").read_text())
        serve.terminate()
        assert serve.wait(60.0) == 0
    finally:
        for process in processes:
            process.kill()
            process.wait()
    flown = load_trajectory(find_trajectory(tmp_path / "flown"))
    assert flown.meta["kind"] == "serve"
    assert check_trajectory(flown).holds
    assert (flown.covered_at < float("inf")).all()
    lines = (tmp_path / "serve.log").read_text().splitlines()
    assert sum("complete: " in line and "% covered" in line for line in lines) == 1, "once"
    assert all(line[:2] == "20" and line[4] == line[7] == "-" for line in lines), "each with the time"


def test_a_controller_that_is_killed_and_started_again_overwrites_nothing(tmp_path):
    (tmp_path / "mission.yaml").write_text(small_mission().to_json())
    endpoint, processes = f"tcp/127.0.0.1:{free_port()}", []

    def start(name, *arguments):
        with (tmp_path / f"{name}.log").open("wb") as out:
            command = [sys.executable, "-m", "mpc_cover", *arguments, "--speed", "4"]
            processes.append(subprocess.Popen(command, cwd=tmp_path, stdout=out, stderr=out, env=dict(os.environ)))
        return processes[-1]

    def serve(name):
        return start(name, "serve", "mission.yaml", "-l", endpoint, "--out", "flown")

    try:
        first = serve("first")
        for name in ("a1", "a2"):
            start(name, "agent", "mission.yaml", "--id", name, "-e", endpoint)
        until(lambda: "flying: 1" in (tmp_path / "first.log").read_text() or flown_in(tmp_path / "flown") is not None)
        first.kill()
        first.wait()
        kept = {file: file.read_bytes() for file in (tmp_path / "flown").rglob("*.jsonl")}
        assert serve("second").wait(60.0) == 0
        assert serve("third").wait(60.0) == 2, "the mission is finished: nothing is resumed"
    finally:
        for process in processes:
            process.kill()
            process.wait()
    assert {file: file.read_bytes() for file in kept} == kept
    assert load_trajectory(find_trajectory(tmp_path / "flown-2")).meta["kind"] == "serve"
    assert "is there already" in (tmp_path / "third.log").read_text()
