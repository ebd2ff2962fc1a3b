"""Real processes over loopback: a second agent of an id, a second controller of a mission; each is refused by name."""

import os
import subprocess
import sys

import pytest
from service_fakes import small_mission, until

from mpc_cover.service.run.processes import free_port


@pytest.fixture
def start(tmp_path):
    """Return a function that starts a command and waits for words in what it writes; all are ended."""
    started = []
    (tmp_path / "mission.yaml").write_text(small_mission().to_json())
    (tmp_path / "other.yaml").write_text(small_mission().to_json().replace('"name":"small"', '"name":"other"'))

    def start(*arguments, words=""):
        log = tmp_path / f"log-{len(started)}"
        with log.open("wb") as out:
            command = [sys.executable, "-m", "mpc_cover", *arguments]
            started.append(subprocess.Popen(command, cwd=tmp_path, stdout=out, stderr=out, env=dict(os.environ)))
        process = started[-1]
        until(lambda: words in log.read_text() or process.poll() is not None, seconds=30.0)
        return process, log

    yield start
    for process in started:
        process.kill()
        process.wait()


@pytest.fixture
def endpoint():
    return f"tcp/127.0.0.1:{free_port()}"


def test_a_second_agent_of_an_id_ends_with_who_is_there_and_the_first_is_still_here(start, endpoint):
    _, said = start("serve", "mission.yaml", "-l", endpoint, words="a1 is not here")
    first, _ = start("agent", "mission.yaml", "--id", "a1", "-e", endpoint, words="agent of small")
    until(lambda: "missed; a2 is not here" in said.read_text())
    second, log = start("agent", "mission.yaml", "--id", "a1", "-e", endpoint, words="another process")
    assert second.wait(20.0) == 2
    assert "mpc-cover: agent a1: another process, instance " in log.read_text()
    assert "Traceback" not in log.read_text()
    assert first.poll() is None
    start("agent", "mission.yaml", "--id", "a2", "-e", endpoint, words="agent of small")
    until(lambda: "plans thoroughly while everyone is at rest" in said.read_text())


def test_a_second_controller_of_a_mission_is_refused_and_an_agent_of_another_mission_is_told(start, endpoint):
    start("serve", "mission.yaml", "-l", endpoint, words="controls small")
    other, log = start("serve", "mission.yaml", "-e", endpoint, "--state-dir", "elsewhere", words="already")
    assert other.wait(20.0) == 2
    assert "mpc-cover: mission small: controller " in log.read_text()
    assert "is on this network already" in log.read_text()
    _, told = start("agent", "other.yaml", "--id", "a1", "-e", endpoint, words="not of other")
    assert "the controller here is of mission small, not of other: no plans will come from it" in told.read_text()


def test_a_controller_that_was_killed_makes_room_at_once(start, endpoint):
    first, _ = start("serve", "mission.yaml", "-l", endpoint, words="controls small")
    start("agent", "mission.yaml", "--id", "a1", "-e", endpoint, words="agent of small")
    first.kill()
    first.wait()
    _, log = start("serve", "mission.yaml", "-l", endpoint, words="controls small")
    assert "already" not in log.read_text()
