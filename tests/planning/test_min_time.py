"""Plans from scratch of the length that it takes: complete, short, verified; honest when they cannot be."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from flights import fleet_of
from motions import EXHAUSTED, PERIOD, UNLIMITED, grid

from mpc_cover.mission.load import load_mission
from mpc_cover.planning.candidate import evaluate_guess
from mpc_cover.planning.free_horizon import Watcher, plan_free_horizon
from mpc_cover.planning.initial_guess.guess import GuessKind
from mpc_cover.planning.min_time import plan_min_time
from mpc_cover.planning.multistart import Search, systematic_guesses
from mpc_cover.planning.offline import offline_task
from mpc_cover.planning.task import Task
from mpc_cover.verification.motion import verify_motion
from solvers.backends.registry import make_backend


def small_task(agents=2, size=8, spacing=0.5):
    """Return a 4 m x 4 m square and a fleet near its corner."""
    start = np.array([[0.6, 0.6], [1.6, 0.6]])[:agents]
    fleet = fleet_of(
        start, separation_min=0.5, communication_range=3.0, motion_min=np.zeros(2), motion_max=np.full(2, 4.0)
    )
    cell = grid(size, spacing)
    return Task(fleet, cell, np.ones((1, cell.shape[0])), start, np.zeros_like(start), 0.0, PERIOD)


def holds(task, plan):
    report = verify_motion(
        task.fleet,
        plan.time,
        plan.position,
        plan.velocity,
        plan.input,
        at_rest=True,
        start=(task.position, task.velocity),
    )
    return report.holds


@pytest.mark.parametrize("backend", ["piqp", "osqp", "clarabel"])
def test_a_whole_plan_covers_everything_and_verifies(backend):
    task = small_task()
    found = plan_free_horizon(task, make_backend(backend), attempts=3, budget=UNLIMITED)
    assert found.complete
    assert holds(task, found.plan)
    assert found.plan.steps * PERIOD < 8.0


@pytest.mark.parametrize("name", ["box-3", "volume-3"])
def test_a_thorough_search_compares_every_kind_of_guess_in_the_plane_and_in_space(name, monkeypatch):
    flown = set()

    def seen(task, guess, steps=None):
        flown.add(guess.origin.kind)
        return evaluate_guess(task, guess, steps)

    monkeypatch.setattr("mpc_cover.planning.free_horizon.evaluate_guess", seen)
    plan_free_horizon(offline_task(load_mission(name)), make_backend("piqp"), attempts=0, budget=UNLIMITED)
    assert flown >= {GuessKind.COMB, GuessKind.SNAKE, GuessKind.STRIPS, GuessKind.TOUR, GuessKind.REST}


def test_a_single_agent_plans_too():
    task = small_task(agents=1)
    found = plan_free_horizon(task, make_backend("piqp"), attempts=4, budget=UNLIMITED)
    assert found.complete
    assert holds(task, found.plan)


def test_a_fleet_that_moves_is_planned_from_its_velocity():
    task = replace(small_task(), velocity=np.array([[0.0, 1.2], [0.0, 1.2]]))
    found = plan_free_horizon(task, make_backend("piqp"), attempts=2, budget=UNLIMITED)
    assert found.feasible
    assert holds(task, found.plan)


def test_with_nothing_owed_it_stays_and_with_no_time_it_still_answers():
    task = small_task()
    nothing = replace(task, weight=np.zeros_like(task.weight))
    assert plan_free_horizon(nothing, make_backend("piqp"), budget=UNLIMITED).plan.position[-1] == pytest.approx(
        task.position
    )
    late = plan_free_horizon(task, make_backend("piqp"), budget=EXHAUSTED)
    assert late.feasible
    assert holds(task, late.plan)


def test_it_is_deterministic():
    one, two = (plan_free_horizon(small_task(), make_backend("piqp"), attempts=2, budget=UNLIMITED) for _ in range(2))
    assert one.plan.velocity.tobytes() == two.plan.velocity.tobytes()


def test_the_shortest_plan_is_complete_and_one_sample_less_was_tried():
    task, told, tried = small_task(), [], []

    class Told(Watcher):
        def tries(self, steps):
            tried.append(steps)

        def found(self, steps, candidate):
            told.append((steps, candidate.complete))

    found = plan_min_time(
        task,
        make_backend("piqp"),
        search=Search(starts=4, finalists=1),
        budget=UNLIMITED,
        watcher=Told(),
        failures=1,
    )
    assert found.complete
    assert holds(task, found.plan)
    assert told[-1] == (found.plan.steps - 1, False)
    assert (found.plan.steps, True) in told
    assert tried[-1] == found.plan.steps - 1
    assert set(tried) <= {steps for steps, _ in told}


def test_a_large_task_that_nothing_keeps_gets_an_answer_that_says_so():
    slow = replace(small_task().fleet, speed_max=np.full(2, 0.02), separation_min=1.5)
    best = plan_free_horizon(replace(small_task(), fleet=slow), make_backend("piqp"), budget=EXHAUSTED)
    assert not best.feasible


def test_a_plan_is_far_shorter_than_guesses_that_suit_the_period_badly():
    """At T_s 1 s guesses turn late: the search used to end at three quarters of the shortest of them, untried."""
    task = replace(small_task(), period=4.0 * PERIOD)
    assert task.period * task.fleet.speed_max.max() > 2.0 * task.fleet.sensing_radius_min
    lengths = [evaluate_guess(task, guess).plan.steps for guess in systematic_guesses(task)]
    found = plan_free_horizon(task, make_backend("piqp"), budget=UNLIMITED)
    assert found.complete
    assert holds(task, found.plan)
    assert found.plan.steps < 0.7 * min(lengths)
