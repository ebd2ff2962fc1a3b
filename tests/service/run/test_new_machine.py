"""Real processes: a controller that knows nothing of the epochs of the one before it; a vehicle whose agent died."""

import os
import subprocess
import sys

import numpy as np
import pytest
from service_fakes import small_mission, until

from mpc_cover.record_seal import seal_of
from mpc_cover.service.agent.recorder import read_record
from mpc_cover.service.run.processes import free_port
from mpc_cover.service.run.run_folder import find_trajectory
from mpc_cover.service.run.sources import check_sources
from mpc_cover.trajectory_file import load_trajectory
from mpc_cover.verification.check import check_trajectory


@pytest.fixture
def start(tmp_path):
    """Return a function that starts a command, its log named; all are ended."""
    started = []
    (tmp_path / "mission.yaml").write_text(small_mission().to_json())

    def start(name, *arguments):
        with (tmp_path / f"{name}.log").open("wb") as out:
            command = [sys.executable, "-m", "mpc_cover", *arguments, "--speed", "4"]
            started.append(subprocess.Popen(command, cwd=tmp_path, stdout=out, stderr=out, env=dict(os.environ)))
        return started[-1]

    yield start
    for process in started:
        process.kill()
        process.wait()


def test_a_new_machine_takes_the_fleet_of_a_dead_one(start, tmp_path):
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    (tmp_path / "old").mkdir()
    (tmp_path / "old" / "epoch").write_text("41\n")
    first = start("first", "serve", "mission.yaml", "-l", endpoint, "--state-dir", "old", "--out", "one")
    for name in ("a1", "a2"):
        start(name, "agent", "mission.yaml", "--id", name, "-e", endpoint)
    until(lambda: all("epoch 42" in (tmp_path / f"{name}.log").read_text() for name in ("a1", "a2")))
    first.kill()
    first.wait()
    second = start("second", "serve", "mission.yaml", "-l", endpoint, "--state-dir", "new", "--out", "two")
    assert second.wait(60.0) == 0
    said = (tmp_path / "second.log").read_text()
    assert "agents have seen epoch 42, and no other controller is here" in said
    assert "this one, of epoch 1, goes on as epoch 43" in said
    assert (tmp_path / "new" / "epoch").read_text() == "43\n"
    flown = load_trajectory(find_trajectory(tmp_path / "two"))
    assert seal_of(flown) is not None
    assert "record as it was written" in {check.name for check in check_trajectory(flown).checks}
    assert check_sources(flown, tmp_path / "two").holds
    assert not {check.name for check in check_trajectory(flown).failures} - {"start position", "start velocity"}


def test_an_agent_that_is_started_again_stands_where_it_was(start, tmp_path):
    """It does not fly from the mission's start once more; the record of the flight has no gap."""
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    serve = start("serve", "serve", "mission.yaml", "-l", endpoint, "--out", "flown")
    agents = {
        name: start(name, "agent", "mission.yaml", "--id", name, "-e", endpoint, "--record", f"{name}.jsonl")
        for name in ("a1", "a2")
    }
    until(lambda: "flies for controller" in (tmp_path / "a2.log").read_text())
    until(lambda: read_record(tmp_path / "a2.jsonl")[1][-1].position[1] > 0.8)
    agents["a2"].kill()
    agents["a2"].wait()
    start("again", "agent", "mission.yaml", "--id", "a2", "-e", endpoint, "--record", "again.jsonl")
    assert serve.wait(60.0) == 0
    assert "a2: stands where it was, at " in (tmp_path / "again.log").read_text()
    last, first = read_record(tmp_path / "a2.jsonl")[1][-1], read_record(tmp_path / "again.jsonl")[1][0]
    velocity = np.array(last.velocity)
    braked = np.array(last.position) + 0.5 * np.linalg.norm(velocity) * velocity
    # what the killed process flew after the last line of its record takes a state period and its share of the machine
    assert np.linalg.norm(np.array(first.position) - braked) < 0.4
    report = check_trajectory(load_trajectory(find_trajectory(tmp_path / "flown")))
    assert report.holds, report.failures
