"""Every command: what it prints, its exit status, and that a mistake is one message and exit status 2."""

import json
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
from pathlib import Path
from threading import Event

import numpy as np
import pytest
import yaml

from mpc_cover import __version__
from mpc_cover.mission.load import shipped_missions
from mpc_cover.trajectory_file import load_trajectory

BOX_3 = next(path for path in shipped_missions() if path.stem == "box-3")


def write_mission(file, changes):
    """Write box-3 with some changes; dots are written as two underscores."""
    raw = yaml.safe_load(BOX_3.read_text(encoding="utf-8"))
    for path, value in changes.items():
        *parents, last = path.split("__")
        here = raw
        for part in parents:
            here = here[int(part) if part.isdigit() else part]
        here[last] = value
    file.write_text(yaml.safe_dump(raw), encoding="utf-8")
    return file


QUICK = {
    "name": "quick",
    "area__shape": {"kind": "box", "min_m": [1.0, 1.0], "max_m": [5.0, 5.0]},
    "control__planning_time_s": 1.0,
}
"""Flown and planned in a second or two."""


@pytest.fixture
def mission(tmp_path):
    """Return a function that writes a mission with mistakes."""
    return lambda **changes: write_mission(tmp_path / "mission.yaml", changes)


@pytest.fixture
def quick(mission):
    return mission(**QUICK)


def test_version(run):
    assert run("--version") == (0, f"mpc-cover {__version__}\n", "")


@pytest.mark.parametrize(
    "command", [(), ("demo",), ("serve",), ("agent",), ("simulate",), ("plan",), ("check",), ("plot",)]
)
def test_help(run, command):
    status, out, err = run(*command, "--help")
    assert status == 0
    assert "Usage: mpc-cover" in out
    assert not err


@pytest.mark.parametrize(
    "command",
    [("nonsense",), ("agent", "box-3"), ("check",), ("demo", "--speed", "fast"), ("serve", "box-3", "--sped", "1")],
)
def test_what_is_no_command_line(run, command):
    status, out, err = run(*command)
    assert (status, out) == (2, "")
    assert "Usage: mpc-cover" in err


def test_nothing_heavy_is_imported_by_an_agent(tmp_path):
    heavy = ["scipy", "cvxpy", "matplotlib", "osqp", "clarabel", "piqp", "shapely", "rich"]
    code = (
        "import sys, mpc_cover.cli, mpc_cover.service.run.serve\n"
        "import mpc_cover.service.agent.agent, mpc_cover.service.agent.recorder\n"
        f"mpc_cover.cli_options.load('box-3'); print([name for name in {heavy} if name in sys.modules])"
    )
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=tmp_path)
    assert out.stdout.strip() in ("[]", "['rich']")  # typer brings rich along


# missions

COMMANDS = [
    pytest.param(("simulate",), id="simulate"),
    pytest.param(("plan",), id="plan"),
    pytest.param(("demo",), id="demo"),
    pytest.param(("serve",), id="serve"),
    pytest.param(("agent", "--id", "a1"), id="agent"),
]


@pytest.mark.parametrize("command", COMMANDS)
def test_a_missing_mission(refused, command):
    message = refused(*command, "nowhere.yaml")
    assert "no such file" in message
    assert "box-3" in message


@pytest.mark.parametrize("command", COMMANDS)
def test_a_mission_that_is_no_yaml(refused, tmp_path, command):
    (tmp_path / "bad.yaml").write_text("area: [1, 2\nfleet: }")
    assert "is not valid YAML" in refused(*command, "bad.yaml")


MISTAKES = {
    "negative radius": ({"fleet__defaults__sensing_radius_m": -1.0}, ["fleet.defaults.sensing_radius_m", "-1.0"]),
    "too close": ({"fleet__agents__1__start_m": [2.1, 2.0]}, ["fleet.agents.1.start_m", "0.1 m from a1"]),
    "not connected": ({"fleet__agents__2__start_m": [9.0, 9.0]}, ["fleet.agents.2.start_m", "is not connected"]),
    "misspelt": ({"fleet__separation_m": 1.0}, ["fleet.separation_m", "is not a known key"]),
    "several": (
        {"control__period_s": -1, "area__cell_size_m": 0, "fleet__agents__0__id": "a b"},
        ["control.period_s", "area.cell_size_m", "fleet.agents.0.id", "3 problems"],
    ),
}


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize(("changes", "words"), MISTAKES.values(), ids=MISTAKES)
def test_a_mission_with_mistakes(refused, mission, command, changes, words):
    message = refused(*command, mission(**changes))
    for word in words:
        assert word in message


# options


def test_an_unknown_agent(refused):
    message = refused("agent", "box-3", "--id", "a9")
    assert "'a9'" in message
    assert "its agents are a1, a2, a3" in message


@pytest.mark.parametrize("command", [("simulate", "box-3"), ("plan", "box-3"), ("demo",), ("serve", "box-3")])
def test_an_unknown_back_end(refused, command):
    message = refused(*command, "--backend", "gurobi")
    for name in ("gurobi", "piqp", "osqp", "clarabel"):
        assert name in message


@pytest.mark.parametrize("command", [("demo",), ("serve", "box-3"), ("agent", "box-3", "--id", "a1")])
@pytest.mark.parametrize("speed", ["0", "-1", "nan", "inf"])
def test_a_speed_that_is_none(refused, command, speed):
    assert "must be a number greater than 0" in refused(*command, "--speed", speed)


SERVICES = [("serve", "box-3"), ("agent", "box-3", "--id", "a1")]


@pytest.mark.parametrize("command", SERVICES)
def test_a_port_in_use(refused, command):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        message = refused(*command, "-l", f"tcp/127.0.0.1:{taken.getsockname()[1]}")
    assert "the port is in use" in message


@pytest.mark.parametrize("command", SERVICES)
def test_an_unreachable_endpoint(refused, command):
    with socket.socket() as closed:
        closed.bind(("127.0.0.1", 0))
        endpoint = f"tcp/127.0.0.1:{closed.getsockname()[1]}"
        message = refused(*command, "-e", endpoint, "--connect-timeout", "0.1")
    assert f"cannot reach {endpoint} within 0.1 s" in message


@pytest.mark.parametrize("command", SERVICES)
@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("-e", "localhost:7447"), "must look like tcp/"),
        (("-l", "tcp/127.0.0.1"), "must look like tcp/"),
        (("--config", "none.json5"), "network configuration none.json5"),
        (("--connect-timeout", "-1"), "--connect-timeout -1"),
        (("--connect-timeout", "nan"), "--connect-timeout nan"),
    ],
)
def test_a_network_that_is_none(refused, command, options, words):
    assert words in refused(*command, *options)


def test_a_state_directory_that_another_controller_uses(refused, tmp_path):
    from mpc_cover.service.controller.state_directory import StateDirectory  # noqa: PLC0415

    with StateDirectory(tmp_path / "state"):
        assert "another controller uses it" in refused("serve", "box-3", "--state-dir", "state")


def test_a_record_that_cannot_be_written(refused):
    assert "cannot be written" in refused("agent", "box-3", "--id", "a1", "--record", "no/where.jsonl")


@pytest.mark.parametrize("command", [("simulate", "box-3"), ("demo",)])
def test_an_out_that_is_not_ours(refused, tmp_path, command):
    (tmp_path / "thesis").mkdir()
    (tmp_path / "thesis" / "chapter-1.txt").write_text("precious")
    assert "is not empty and not a run of mpc-cover" in refused(*command, "--out", "thesis")
    (tmp_path / "file").write_text("")
    assert "cannot be written" in refused(*command, "--out", "file")
    assert "cannot be written" in refused(*command, "--out", "file/run")


@pytest.mark.parametrize(("out", "words"), [("plan.txt", "must end in .npz"), ("no/plan.npz", "cannot be written")])
def test_a_plan_that_cannot_be_written(refused, out, words):
    assert words in refused("plan", "box-3", "--out", out)


# runs


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """One run, made once: its folder, its mission, and what was printed."""
    folder = tmp_path_factory.mktemp("made")
    write_mission(folder / "mission.yaml", QUICK)
    command = [sys.executable, "-m", "mpc_cover", "simulate", "mission.yaml", "--out", "run", "--json"]
    out = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True).stdout
    return folder, json.loads(out)


@pytest.fixture
def simulated(made, tmp_path):
    """The run in a folder of the test's own; what was printed."""
    shutil.copytree(made[0], tmp_path, dirs_exist_ok=True)
    return made[1]


def test_simulate_writes_a_run_and_says_so_in_json(simulated, tmp_path):
    assert simulated["holds"]
    assert simulated["covered_percent"] == 100.0
    assert simulated["step_times"]["steps"] > 0
    names = {path.name for path in (tmp_path / "run").iterdir()}
    assert {"trajectory.npz", "step_times.npz", "summary.json", "mission.json", "run.json", "overview.png"} <= names


def test_a_run_of_ours_is_written_anew(simulated, run, tmp_path):
    first = (tmp_path / "run" / "trajectory.npz").read_bytes()
    (tmp_path / "run" / "stale.png").write_bytes(b"")
    assert run("simulate", "mission.yaml", "--out", "run")[0] == 0
    assert (tmp_path / "run" / "trajectory.npz").read_bytes() == first
    assert not (tmp_path / "run" / "stale.png").exists()


def test_simulate_without_out_names_the_run_after_the_mission(run, quick, tmp_path):
    status, out, err = run("simulate", quick)
    assert (status, err) == (0, "")
    (folder,) = (tmp_path / "runs").iterdir()
    assert re.fullmatch(r"quick-\d{8}-\d{6}", folder.name)
    assert f"runs/{folder.name}" in out
    assert "100.00 %" in out


def test_check_says_what_holds(simulated, run):
    for path in ("run", "run/trajectory.npz"):
        status, out, err = run("check", path)
        assert (status, err) == (0, "")
        assert "separation" in out
    status, out, err = run("check", "run", "--json")
    assert status == 0
    assert json.loads(out)["holds"]
    assert "separation" in err


def test_check_finds_a_violation(simulated, run, tmp_path):
    damage(tmp_path / "run" / "trajectory.npz", input=lambda a: a * 1.5)
    status, out, _ = run("check", "run", "--json")
    assert status == 1
    assert not json.loads(out)["holds"]


def damage(file, **changes):
    with np.load(file) as archive:
        arrays = {name: archive[name] for name in archive.files}
    for name, change in changes.items():
        arrays[name] = change(arrays[name])
    np.savez(file, **arrays)


def nan(array):
    array[1, 0, 0] = np.nan
    return array


@pytest.mark.parametrize("command", ["check", "plot"])
def test_a_bad_trajectory(simulated, refused, tmp_path, command):
    file = tmp_path / "run" / "trajectory.npz"
    whole = file.read_bytes()
    for length in (0, 10, len(whole) // 2, len(whole) - 1):
        file.write_bytes(whole[:length])
        assert "cannot be read" in refused(command, file)
        assert "cannot be read" in refused(command, "run")
    file.write_bytes(whole)
    damage(file, position=nan)
    assert "position[1, 0, 0]: nan: must be finite" in refused(command, file)
    assert "cannot be read" in refused(command, "none.npz")
    (tmp_path / "empty").mkdir()
    assert "cannot be read" in refused(command, "empty")


def test_bad_step_times(simulated, refused, tmp_path):
    (tmp_path / "run" / "step_times.npz").write_bytes(b"junk")
    assert "step times" in refused("plot", "run")


@pytest.mark.parametrize("command", ["simulate", "demo"])
@pytest.mark.parametrize("kill", ["a2", "a9@3", "a2@-1", "a2@soon"])
def test_deaths_that_cannot_be(refused, quick, tmp_path, command, kill):
    message = refused(command, quick, "--out", "run", "--kill", kill)
    assert "--kill" in message
    assert kill in message
    assert not (tmp_path / "run").exists()


def test_a_death_is_simulated_and_told(run, quick):
    status, out, err = run("simulate", quick, "--out", "run", "--json", "--kill", "a2@1.5")
    summary = json.loads(out)
    assert status == 0
    assert summary["lost"] == ["a2"]
    assert summary["outcome"] == "everything is covered, and everyone but a2 is at rest"
    assert summary["outcome"] in err
    assert run("check", "run")[0] == 0


def test_plan_and_plot(run, quick, tmp_path):
    status, out, _ = run("plan", quick, "--out", "p.npz", "--json")
    summary = json.loads(out)
    assert status == 0
    assert summary["kind"] == "plan"
    assert summary["holds"]
    assert load_trajectory(tmp_path / "p.npz").meta["kind"] == "plan"
    status, out, err = run("plot", "p.npz")
    assert (status, err) == (0, "")
    files = [Path(line) for line in out.splitlines()]
    assert all(file.read_bytes().startswith(b"\x89PNG") for file in files)
    assert {file.parent for file in files} == {Path("p")}
    assert run("plot", "p.npz", "--out", "elsewhere")[1].startswith("elsewhere")


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


def test_a_step_of_the_maps_is_measured(run, refused):
    status, out, err = run("bench", "maps", "--steps", "2", "--json")
    assert status == 0, err
    report = json.loads(out)
    assert (report["cells"], report["agents"]) == (317**2, 50)
    assert len(report["maps"]) == 10
    assert all(0.0 < row["p50_ms"] <= row["p99_ms"] for row in report["maps"])
    assert "--steps 0: must be from 1 to" in refused("bench", "maps", "--steps", "0")
