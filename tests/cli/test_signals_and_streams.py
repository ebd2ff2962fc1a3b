"""Signals and broken streams, with real processes: what was found is kept, nothing dies of what it cannot print."""

import os
import signal
import subprocess
import sys
import time
from threading import Event

import pytest
from quick_missions import QUICK, write_mission

from mpc_cover.planning.planner import Planner
from mpc_cover.service.run.processes import free_port
from mpc_cover.service.run.progress import Progress
from mpc_cover.trajectory_file import load_trajectory

IDS = ("a1", "a2", "a3")
COMMANDS = [("plan", "quick.yaml"), ("simulate", "quick.yaml"), ("check", "run", "--json")]


def until(condition, seconds=20.0):
    """Wait for a condition that another process brings about."""
    deadline, waiting = time.monotonic() + seconds, Event()
    while not condition():
        assert time.monotonic() < deadline, "it did not come about"
        waiting.wait(0.01)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with missions, and a run of one of them."""
    folder = tmp_path_factory.mktemp("signals")
    write_mission(folder / "quick.yaml", QUICK)
    subprocess.run([*command("simulate", "quick.yaml", "--out", "run")], cwd=folder, check=True, capture_output=True)
    return folder


def command(*arguments):
    return [sys.executable, "-m", "mpc_cover", *map(str, arguments)]


def start(folder, *arguments, log):
    with (folder / log).open("wb") as out:
        return subprocess.Popen(command(*arguments), cwd=folder, stdout=out, stderr=out, env=dict(os.environ))


def interrupted(folder, words, *arguments, number=signal.SIGINT):
    """Send a signal once a command has written some words; return its exit status, and all that it wrote."""
    log = folder / f"{arguments[0]}-{number}.log"
    process = start(folder, *arguments, log=log.name)
    try:
        until(lambda: words in log.read_text() or process.poll() is not None, seconds=60.0)
        process.send_signal(number)
        return process.wait(30.0), log.read_text()
    finally:
        process.kill()
        process.wait()


def test_what_a_search_for_the_shortest_plan_has_found_is_written(folder):
    out = folder / "shortest.npz"
    status, said = interrupted(folder, "covers everything", "plan", "quick.yaml", "--min-time", "--out", out)
    assert status == 130
    assert out.is_file()
    assert "Interrupted: the best plan until then." in said
    assert "Traceback" not in said
    assert subprocess.run(command("check", out), check=False, capture_output=True).returncode == 0


@pytest.mark.parametrize("law", ["mpc", "potential"])
def test_what_was_flown_in_simulation_is_written(run, tmp_path, monkeypatch, law):
    write_mission(tmp_path / "quick.yaml", QUICK)

    def interrupt(_, status):
        if status.mission_time_s > 1.0:
            raise KeyboardInterrupt

    monkeypatch.setattr(Progress, "show", interrupt)
    status, out, _ = run("simulate", "quick.yaml", "--controller", law, "--out", "cut")
    assert status == 130
    assert "interrupted" in out
    assert load_trajectory(tmp_path / "cut" / "trajectory.npz").end_time >= 1.0
    assert run("check", "cut")[0] == 1


@pytest.mark.parametrize("name", ["plan", "simulate"])
def test_ctrl_c_before_there_is_anything_is_one_line_at_most(run, tmp_path, monkeypatch, name):
    write_mission(tmp_path / "quick.yaml", QUICK)

    def interrupt(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(Planner, "thorough", interrupt)
    monkeypatch.setattr(Planner, "fixed", interrupt)
    status, _, err = run(name, "quick.yaml")
    assert status == 130
    assert err.count("\n") <= 1


def test_ctrl_c_while_it_imports_is_no_traceback(folder):
    program = """
import builtins, os, signal, sys
sys.argv, real = ["mpc-cover", "plan", "box-3"], builtins.__import__
def hooked(name, *given, **named):
    if name == "typer":
        os.kill(os.getpid(), signal.SIGINT)
    return real(name, *given, **named)
builtins.__import__ = hooked
from mpc_cover.__main__ import main
main()
"""
    ended = subprocess.run([sys.executable, "-c", program], cwd=folder, capture_output=True, text=True, check=False)
    assert (ended.returncode, ended.stderr) == (130, "")


@pytest.mark.parametrize(("number", "status"), [(signal.SIGINT, 130), (signal.SIGTERM, 0)])
def test_daemons_end_cleanly(folder, number, status):
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    serve = start(folder, "serve", "quick.yaml", "-l", endpoint, "--state-dir", f"s{number}", log="serve.log")
    try:
        until(lambda: "controls quick" in (folder / "serve.log").read_text())
        ended = interrupted(
            folder, "agent of quick", "agent", "quick.yaml", "--id", "a1", "-e", endpoint, number=number
        )
        serve.send_signal(number)
        assert (ended[0], serve.wait(20.0)) == (status, status)
        assert "Traceback" not in ended[1] + (folder / "serve.log").read_text()
    finally:
        serve.kill()
        serve.wait()


@pytest.mark.parametrize("arguments", COMMANDS, ids=" ".join)
def test_a_reader_that_leaves_ends_no_command(folder, arguments):
    read, write = os.pipe()
    os.close(read)
    ended = subprocess.run(
        command(*arguments), cwd=folder, stdout=write, stderr=subprocess.PIPE, text=True, check=False
    )
    os.close(write)
    assert ended.returncode == 0, ended.stderr
    assert "Traceback" not in ended.stderr
    assert "BrokenPipe" not in ended.stderr


@pytest.mark.parametrize("arguments", COMMANDS, ids=" ".join)
def test_a_full_disk_is_told_in_a_line(folder, arguments):
    with open("/dev/full", "w") as full:  # noqa: PTH123 - a device
        ended = subprocess.run(
            command(*arguments), cwd=folder, stdout=full, stderr=subprocess.PIPE, text=True, check=False
        )
    assert ended.returncode == 1
    assert "mpc-cover: standard output: cannot be written: No space left on device" in ended.stderr
    assert "Traceback" not in ended.stderr


def test_a_daemon_whose_reader_leaves_flies_on(folder):
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    arguments = command("serve", "quick.yaml", "-l", endpoint, "--state-dir", "pipe", "--speed", "8")
    serve = subprocess.Popen(arguments, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    agents = []
    try:
        assert serve.stdout.readline()
        serve.stdout.close()
        own = ("-e", endpoint, "--speed", "8")
        agents += [start(folder, "agent", "quick.yaml", "--id", name, *own, log=f"{name}.log") for name in IDS]
        assert serve.wait(60.0) == 0
    finally:
        for process in (serve, *agents):
            process.kill()
            process.wait()
