"""Real processes over real Zenoh: they fly, survive each other, and never outlive the demo."""

import json
import os
import signal
import subprocess
from pathlib import Path

import pytest
from service_fakes import small_mission, until
from watched_demo import alive, holds

from mpc_cover.trajectory_file import load_trajectory
from mpc_cover.verification.check import check_trajectory


def test_a_mission_from_end_to_end(start):
    demo = start(small_mission(), "--speed", "4", "--seed", "7")
    summary = demo.end(0)
    assert summary["covered_percent"] == 100.0
    assert summary["outcome"] == "everything is covered"
    assert summary["step_times"]["steps"] > 0
    names = {path.name for path in demo.folder.iterdir()}
    assert {"trajectory.npz", "step_times.npz", "summary.json", "mission.json", "overview.png", "logs"} <= names
    trajectory = load_trajectory(demo.folder / "trajectory.npz")
    assert check_trajectory(trajectory).holds
    assert trajectory.meta["kind"] == "demo"
    assert (trajectory.meta["seed"], trajectory.meta["speed"]) == (7, 4.0)
    assert json.loads((demo.folder / "summary.json").read_text())["holds"]


def test_the_controller_is_killed_and_its_successor_finishes(start):
    demo = start(small_mission(height=9.0, horizon_steps=5), "--speed", "2")
    demo.wait_for("controller: flying")
    os.kill(demo.pids()["controller"], signal.SIGKILL)
    summary = demo.end(0)
    assert summary["controller_restarts"] == 1
    assert summary["covered_percent"] == 100.0
    assert "the controller died (exit status -9): the agents finish their plans" in demo.said
    assert "epoch 2" in demo.said
    assert holds(demo.folder)


@pytest.mark.parametrize(
    "moment",
    [
        pytest.param("run folder", marks=pytest.mark.slow),
        pytest.param("processes: ", marks=pytest.mark.slow),
        pytest.param("plans thoroughly", marks=pytest.mark.slow),
        "controller: flying",
    ],
)
def test_ctrl_c_ends_everything_and_leaves_what_was_flown(start, moment):
    demo = start(small_mission(height=9.0))
    demo.wait_for(moment)
    demo.process.send_signal(signal.SIGINT)
    if moment == "run folder":
        assert demo.process.wait(60.0) == 130
    else:
        assert demo.end(130)["outcome"] == "interrupted"
    assert json.loads((demo.folder / "summary.json").read_text())["outcome"] == "interrupted"
    if moment == "controller: flying":
        assert holds(demo.folder)


def test_a_killed_demo_takes_its_children_along(start):
    demo = start(small_mission(height=9.0))
    demo.wait_for("controller: flying")
    pids = demo.pids()
    demo.process.kill()
    until(lambda: not any(alive(pid) for pid in pids.values()))


def test_the_others_finish_without_a_dead_agent(start):
    demo = start(small_mission(height=6.0, reach=20.0), "--speed", "4")
    demo.wait_for("a2: flies for controller")
    os.kill(demo.pids()["a2"], signal.SIGKILL)
    summary = demo.end(0)
    assert summary["outcome"] == "everything is covered without a2"
    assert summary["covered_percent"] == 100.0
    assert "a2 died (exit status -9)" in demo.said
    assert "controller: a2 is lost: its work is shared out" in demo.said
    assert json.loads((demo.folder / "summary.json").read_text())["lost"] == ["a2"]
    trajectory = load_trajectory(demo.folder / "trajectory.npz")
    assert check_trajectory(trajectory).holds
    assert list(trajectory.meta["lost"]) == ["a2"]
    assert not trajectory.velocity[-1, 1].any()


def test_a_death_that_was_asked_for(start):
    demo = start(small_mission(height=6.0, reach=20.0), "--speed", "4", "--kill", "a2@1.5", "--seed", "5")
    assert b"--seed\x005\x00" in Path(f"/proc/{demo.pids()['a1']}/cmdline").read_bytes()
    summary = demo.end(0)
    assert summary["lost"] == ["a2"]
    assert summary["outcome"] == "everything is covered without a2"
    died = load_trajectory(demo.folder / "trajectory.npz").meta["lost"]["a2"]
    assert died > 1.0
    assert holds(demo.folder)


@pytest.mark.slow
def test_disturbed_demos_keep_every_limit_with_any_seed(start):
    from mpc_cover.mission.load import load_mission  # noqa: PLC0415 - only here

    summary = start(load_mission("box-3-windy"), "--seed", "3").end(0)
    assert summary["covered_percent"] == 100.0
    assert summary["holds"]


@pytest.mark.parametrize("moment", ["processes: ", pytest.param("plans thoroughly", marks=pytest.mark.slow)])
def test_an_agent_that_dies_before_the_start_ends_the_demo(start, moment):
    demo = start(small_mission(height=9.0, planning_time_s=3.0))
    demo.wait_for(moment)
    os.kill(demo.pids()["a2"], signal.SIGKILL)
    assert demo.end(1)["outcome"] == "a2 died"


def test_when_all_agents_die_the_demo_ends(start):
    demo = start(small_mission(height=9.0))
    demo.wait_for("a2: flies for controller")
    for name in ("a1", "a2"):
        os.kill(demo.pids()[name], signal.SIGKILL)
    assert demo.end(1)["outcome"] == "a1, a2 died"
    assert holds(demo.folder)


@pytest.mark.slow
def test_a_hung_agent_is_done_without_until_it_comes_back(start):
    demo = start(small_mission(height=9.0, reach=20.0, horizon_steps=6), "--speed", "2")
    demo.wait_for("a2: flies for controller")
    pid = demo.pids()["a2"]
    os.kill(pid, signal.SIGSTOP)
    demo.wait_for("a2 is lost")
    os.kill(pid, signal.SIGCONT)
    demo.wait_for("a2 is back")
    summary = demo.end(0)
    assert summary["outcome"] == "everything is covered"
    assert holds(demo.folder)


@pytest.mark.slow
def test_disturbed_agents_keep_every_limit(start):
    disturbance = {"position_noise_m": 0.01, "input_noise_m_per_s2": 0.02, "wind_m_per_s2": [0.03, 0.0], "delay_s": 0.2}
    demo = start(small_mission(height=6.0, disturbance=disturbance), "--speed", "2")
    assert demo.end(0)["covered_percent"] == 100.0
    assert holds(demo.folder)


@pytest.mark.slow
def test_a_stopped_controller_goes_on_where_its_agents_are(start):
    demo = start(small_mission(height=9.0, horizon_steps=5), "--speed", "2")
    demo.wait_for("controller: flying")
    pid = demo.pids()["controller"]
    os.kill(pid, signal.SIGSTOP)
    with pytest.raises(subprocess.TimeoutExpired):
        demo.process.wait(4.0)
    os.kill(pid, signal.SIGCONT)
    assert demo.end(0)["covered_percent"] == 100.0
    assert holds(demo.folder)


@pytest.mark.slow
@pytest.mark.parametrize("backend", ["piqp", "clarabel", "osqp"])
def test_box_3(start, backend):
    from mpc_cover.mission.load import load_mission  # noqa: PLC0415 - only here

    summary = start(load_mission("box-3"), "--backend", backend).end(0)
    assert summary["covered_percent"] >= 95.0
    assert summary["holds"]
    assert summary["step_times"]["p99_ms"] < 500.0
