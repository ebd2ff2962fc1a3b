"""A fleet without a controller as real processes over Zenoh: it ends by itself, also without one of its agents."""

import json
import os
import signal

import pytest
from swarm_missions import swarm_mission
from watched_demo import holds

POTENTIAL = ("--controller", "potential", "--speed", "8")


def test_it_flies_to_the_end_by_itself(start):
    demo = start(swarm_mission(size=4.0), *POTENTIAL, "--seed", "3")
    summary = demo.end(0)
    assert summary["outcome"] == "everything is covered"
    assert summary["covered_percent"] == 100.0
    assert holds(demo.folder)
    saved = json.loads((demo.folder / "summary.json").read_text())
    assert saved["controller"] == "potential"
    assert (demo.folder / "overview.png").is_file()
    assert "controller" not in demo.pids()


def test_one_is_killed_and_the_others_finish(start):
    demo = start(swarm_mission(4), *POTENTIAL, "--seed", "1")
    demo.wait_for("a3: flies")
    demo.wait_for("covered  ")
    os.kill(demo.pids()["a3"], signal.SIGKILL)
    summary = demo.end(0)
    assert summary["outcome"] == "everything is covered without a3"
    assert summary["lost"] == ["a3"]
    assert holds(demo.folder)


@pytest.mark.slow
def test_ctrl_c_leaves_what_was_flown(start):
    demo = start(swarm_mission(size=9.0), *POTENTIAL)
    demo.wait_for("a1: flies")
    demo.process.send_signal(signal.SIGINT)
    assert demo.end(130)["outcome"] == "interrupted"


def test_agents_killed_before_the_start_are_not_waited_for_for_ever(start):
    demo = start(swarm_mission(), "--controller", "potential")
    os.kill(demo.pids()["a2"], signal.SIGKILL)
    summary = demo.end(1)
    assert "a2 died" in summary["outcome"] or "without a2" in summary["outcome"]
