"""Each peer has a process of its own, and nothing that it does there ends the benchmark."""

from __future__ import annotations

import os
import threading
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bench_missions import small_mission

from mpc_cover.studies import race as race_module
from mpc_cover.studies.case import make_case, start_from
from mpc_cover.studies.peers.registry import PEERS, Entry
from mpc_cover.studies.race import Failure, Limit, Run, race, solved
from mpc_cover.studies.verdict import judge
from mpc_cover.studies.watch import Answer, Sighting


@pytest.fixture
def problem():
    mission = small_mission({"duration_s": 3.0})
    return mission, start_from(make_case(mission), "boustrophedon")


def die(connection, name, mission, x, limit, log):
    """Crash as native code does, with a last word."""
    Path(log).write_text("terrible\nthings happened\n", encoding="utf-8")
    os._exit(7)


def hang(connection, name, mission, x, limit, log):
    """Heed nothing."""
    connection.send(0.5)
    threading.Event().wait()


def test_a_peer_runs_in_a_process_of_its_own(problem):
    mission, x = problem
    told = []
    run = race("ours-piqp", mission, x, Limit(60.0), lambda run: told.append(len(run.seen)))
    assert run.answered
    assert run.iterations > 0
    assert told[-1] == len(run.seen) > 1
    assert run.best.verdict.cost < run.seen[0][1].cost
    assert judge(make_case(mission), run.best.x) == run.best.verdict


def test_a_crash_is_a_row_with_the_last_words(problem, monkeypatch):
    monkeypatch.setattr(race_module, "compete", die)
    run = race("ours-piqp", *problem, Limit(60.0))
    assert run.status == "died (exit status 7): things happened"
    assert not run.answered
    assert run.best is None


def test_whoever_hangs_is_stopped(problem, monkeypatch):
    monkeypatch.setattr(race_module, "compete", hang)
    monkeypatch.setattr(race_module, "GRACE_S", 0.05)
    run = race("ours-piqp", *problem, Limit(0.05))
    assert run.status.startswith("stopped")
    assert run.setup_s == 0.5


def test_processes_start_with_one_thread_and_ours_goes_on_as_before(problem, monkeypatch):
    monkeypatch.setenv("OMP_NUM_THREADS", "5")
    monkeypatch.delenv("OPENBLAS_NUM_THREADS", raising=False)
    with race_module._one_thread():
        assert os.environ["OMP_NUM_THREADS"] == os.environ["OPENBLAS_NUM_THREADS"] == "1"
    assert os.environ["OMP_NUM_THREADS"] == "5"
    assert "OPENBLAS_NUM_THREADS" not in os.environ


class Broken(Entry):
    """A peer that cannot be imported, or breaks."""

    def load(self):
        raise self.options["error"]


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (
            ModuleNotFoundError("No module named 'casadi'", name="casadi"),
            "not installed: pip install 'mpc-cover[peers]'",
        ),
        (ModuleNotFoundError("No module named 'xyz'", name="xyz"), "failed: No module named 'xyz'"),
        (ValueError("two\nlines"), "failed: ValueError: two lines"),
        (NotImplementedError("several looks"), "cannot solve this mission: several looks"),
    ],
)
def test_a_peer_that_fails_says_why(problem, monkeypatch, error, words):
    monkeypatch.setitem(PEERS, "broken", Broken("broken", "", "", "", {"error": error}))
    mission, x = problem
    found = solved("broken", mission.to_json(), x, Limit(1.0), lambda _: None)
    assert found == Failure(words)


def test_the_iterate_that_counts_holds_at_the_samples_and_costs_least(problem):
    mission, x = problem
    fine = judge(make_case(mission), x)
    run = Run("someone")
    verdicts = [
        replace(fine, cost=1.0, sampled=0.5, path=0.5),
        replace(fine, cost=3.0, sampled=0.0, path=0.0),
        replace(fine, cost=2.0, sampled=0.0, path=0.3),
        replace(fine, cost=2.5, sampled=0.0, path=0.0),
    ]
    for k, verdict in enumerate(verdicts):
        run.take(Sighting(float(k), np.array([float(k)]), verdict))
    assert run.best.time_s == 2.0
    assert run.flyable.time_s == 3.0
    run.take(Failure("gave up"))
    assert run.status == "gave up"
    run.take(Answer(x, 4, "fine", 9.0))
    assert (run.time_s, run.iterations, run.answered) == (9.0, 4, True)


def test_on_a_busy_machine_processor_time_counts_and_the_wall_may_take_longer(problem):
    by_wall, by_processor = Limit(10.0), Limit(10.0, cpu_time=True)
    assert by_wall.wall_s(4.0) == 6.0
    assert by_processor.wall_s(4.0) > by_wall.wall_s(4.0)
    assert by_processor.wall_s(11.0) == 0.0
    mission, x = problem
    told = []
    answer = solved("ours-piqp", mission.to_json(), x, Limit(60.0, cpu_time=True), told.append)
    assert answer.time_s > 0.0
    assert len(told) > 2
