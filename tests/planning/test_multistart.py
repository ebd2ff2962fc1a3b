"""Plans of a given length from several starts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from flights import fleet_of
from motions import PERIOD, UNLIMITED, grid

from mpc_cover.planning.budget import Budget
from mpc_cover.planning.multistart import Search, initial_guesses, multistart, systematic_guesses
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


def test_what_is_too_short_for_everything_is_still_feasible_and_best_effort():
    task = small_task()
    found = multistart(task, make_backend("piqp"), 4, Search(), UNLIMITED)[0]
    assert found.feasible
    assert not found.complete
    assert found.plan.steps == 4
    assert holds(task, found.plan)


def test_a_start_that_is_given_takes_the_way_of_a_guess():
    task, backend, alone = small_task(), make_backend("piqp"), Search(starts=1, finalists=1, rounds=2)
    guess = next(initial_guesses(task, alone))
    x = task.ocp(12).decision_of(task.flown(guess, 12))
    own, given = (multistart(task, backend, 12, alone, UNLIMITED, given=start) for start in (None, {"mine": x}))
    assert [one.plan.velocity.tobytes() for one in own] == [one.plan.velocity.tobytes() for one in given]
    assert {one.origin.name for one in given} == {"mine", "rest"}


def test_whoever_looks_on_sees_all_iterates_and_changes_nothing():
    seen = []
    task, search = small_task(), Search(starts=2, finalists=1, rounds=1)
    plain = multistart(task, make_backend("piqp"), 9, search, UNLIMITED)
    looked_at = multistart(replace(task, on_iterate=seen.append), make_backend("piqp"), 9, search, UNLIMITED)
    assert [one.plan.velocity.tobytes() for one in plain] == [one.plan.velocity.tobytes() for one in looked_at]
    taken = [step for one in plain if one.refined for stage in one.refined.stages for step in stage.history]
    assert len(seen) >= sum(step.accepted for step in taken) > 0
    best, ocp = looked_at[0], task.ocp(9)
    assert any(np.array_equal(ocp.motion(x)[1], best.plan.velocity) for x in seen)


def test_whoever_looks_on_may_end_the_search():
    with pytest.raises(ZeroDivisionError):
        multistart(replace(small_task(), on_iterate=lambda _: 1 / 0), make_backend("piqp"), 9, Search(), UNLIMITED)


def test_more_starts_are_random_relatives_and_the_same_for_a_seed():
    task = small_task()
    names = [
        [g.origin.name for g, _ in zip(initial_guesses(task, Search(seed=4)), range(24), strict=False)]
        for _ in range(2)
    ]
    assert names[0] == names[1]
    assert len(set(names[0])) == 24
    assert "random" in names[0][-1]
    only = list(initial_guesses(task, Search(names=("tour", names[0][1]))))
    assert [guess.origin.name for guess in only] == ["tour", names[0][1]]


def test_guesses_are_made_while_the_budget_lasts_and_one_in_any_case():
    task, spent = small_task(), Budget.counted(0.0)
    (only,) = systematic_guesses(task, spent)
    assert only.origin in {guess.origin for guess in systematic_guesses(small_task())}
    assert len(systematic_guesses(small_task(), Budget.counted(1.0))) > 1
