"""`mpc-cover simulate`: the run that it writes, its JSON, its exit status, and Ctrl-C."""

import json
import os
import re
import signal
import subprocess
import sys
from threading import Event

import pytest
from quick_missions import QUICK, write_mission


def test_simulate_writes_a_run_and_says_so_in_json(simulated, tmp_path):
    assert simulated["holds"]
    assert simulated["covered_percent"] == 100.0
    assert simulated["step_times"]["steps"] > 0
    names = {path.name for path in (tmp_path / "run").iterdir()}
    assert {"trajectory.npz", "step_times.npz", "summary.json", "mission.json", "run.json", "overview.png"} <= names


def test_a_run_of_ours_is_written_anew(simulated, run, tmp_path):
    first = (tmp_path / "run" / "trajectory.npz").read_bytes()
    (tmp_path / "run" / "stale.png").write_bytes(b"")
    assert run("simulate", "mission.yaml", "--out", "run", "--overwrite")[0] == 0
    assert (tmp_path / "run" / "trajectory.npz").read_bytes() == first
    assert not (tmp_path / "run" / "stale.png").exists()


def test_simulate_without_out_names_the_run_after_the_mission(run, quick, tmp_path):
    status, out, err = run("simulate", quick)
    shown = ("covered ", "plans while everyone is at rest (")
    assert (status, [line for line in err.splitlines() if not line.startswith(shown)]) == (0, [])
    (folder,) = (tmp_path / "runs").iterdir()
    assert re.fullmatch(r"quick-\d{8}-\d{6}", folder.name)
    assert f"runs/{folder.name}" in out
    assert "100.00 %" in out


@pytest.mark.parametrize("controller", ["mpc", "potential"])
@pytest.mark.parametrize("agents", [1, 2])
def test_when_everything_is_in_range_at_the_start_that_is_a_success_with_a_record(run, tmp_path, controller, agents):
    fleet = [{"id": "a1", "start_m": [2.0, 2.0]}, {"id": "a2", "start_m": [4.0, 2.0]}][:agents]
    changes = QUICK | {"fleet__agents": fleet, "fleet__defaults__sensing_radius_m": 10.0}
    mission = write_mission(tmp_path / "near.yaml", changes)
    status, out, _ = run("simulate", mission, "--out", "run", "--json", "--controller", controller)
    assert status == 0
    assert json.loads(out)["time_to_100_s"] == 0.0
    assert run("check", "run")[0] == 0
    assert run("plot", "run")[0] == 0


def test_a_death_is_simulated_and_told(run, quick):
    status, out, err = run("simulate", quick, "--out", "run", "--json", "--kill", "a2@1.5")
    summary = json.loads(out)
    assert status == 0
    assert summary["lost"] == ["a2"]
    assert summary["outcome"] == "everything is covered, and everyone but a2 is at rest"
    assert summary["outcome"] in err
    assert run("check", "run")[0] == 0


_AS_ON_A_TERMINAL = """
import signal, sys
from mpc_cover.cli import main
signal.signal(signal.SIGINT, signal.default_int_handler)
sys.argv[0] = "mpc-cover"
main()
"""
"""Whoever is started in the background of a script ignores Ctrl-C, and so do all that it starts."""


def test_ctrl_c_in_a_simulation(tmp_path):
    command = [sys.executable, "-c", _AS_ON_A_TERMINAL, "simulate", "box-3", "--out", "run"]
    with subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        waiting = Event()
        while not (tmp_path / "run" / "mission.json").exists() and process.poll() is None:
            waiting.wait(0.01)
        os.kill(process.pid, signal.SIGINT)
        _, err = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "Traceback" not in err


def test_simulate_without_a_controller(run, tiny):
    status, out, _ = run("simulate", tiny, "--controller", "potential", "--out", "r", "--json", "--seed", 3)
    data = json.loads(out)
    assert status == 0
    assert data["complete"]
    assert data["covered_percent"] == 100.0
    assert data["controller"] == "potential"
    assert data["outcome"] == "everything is covered"
    assert data["messages"] > 0
    assert run("check", "r")[0] == 0
