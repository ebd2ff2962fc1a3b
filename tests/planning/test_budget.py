"""What planning may take: parts of one clock, kept to, and counted work the same every time."""

from __future__ import annotations

import time

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from motions import random_window

from mpc_cover.mission.load import load_mission
from mpc_cover.model.fleet_constraints import FleetConstraints
from mpc_cover.planning.budget import Budget
from mpc_cover.planning.free_horizon import plan_free_horizon
from mpc_cover.planning.planner import Planner
from mpc_cover.planning.scp import optimise
from mpc_cover.planning.task import Task
from solvers.backends.piqp_ import PIQPBackend
from solvers.backends.registry import BACKENDS, make_backend

seconds = st.floats(0.0, 100.0)


@given(seconds, st.lists(seconds, max_size=6))
def test_counted_work_is_all_that_a_counted_budget_loses(given_s, charges):
    budget = Budget.counted(given_s)
    for number, charge in enumerate(charges):
        budget.charge(charge)
        assert budget.left_s == pytest.approx(given_s - sum(charges[: number + 1]))
        assert budget.exhausted == (budget.left_s <= 0.0)


@given(seconds, seconds, st.floats(0.0, 1.0), seconds)
def test_a_part_is_a_share_of_what_is_left_and_its_work_is_the_work_of_all(given_s, before, share, charge):
    budget = Budget.counted(given_s)
    budget.charge(before)
    left = max(given_s - before, 0.0)
    part = budget.part(share)
    assert part.left_s == pytest.approx(share * left)
    part.charge(charge)
    assert part.left_s == pytest.approx(share * left - charge)
    assert budget.left_s == pytest.approx(given_s - before - charge)
    if charge > share * left + 1e-6:
        assert part.exhausted


@given(seconds, seconds)
def test_an_extended_budget_has_so_much_more_of_the_same_clock(given_s, more):
    budget = Budget.counted(given_s)
    longer = budget.extended(more)
    budget.charge(given_s)
    assert longer.left_s == pytest.approx(more)
    assert budget.exhausted


def test_time_passes_by_itself_and_counted_work_does_not():
    now = time.perf_counter()
    past, future = Budget.until(now - 1.0), Budget.until(now + 1e6)
    assert past.exhausted
    assert past.part(0.5).exhausted
    future.charge(2e6)
    assert 1e6 - 60.0 < future.left_s <= 1e6
    assert 1e3 - 60.0 < Budget.wall_clock(1e3).left_s <= 1e3
    counted = Budget.counted(1.0)
    assert counted.left_s == counted.left_s == 1.0


def test_nothing_exhausts_an_unlimited_budget():
    budget = Budget.unlimited()
    budget.charge(1e9)
    assert not budget.part(1e-9).exhausted
    assert budget.deadline is None
    assert Budget.counted(3.0).deadline == 3.0


def test_only_counted_budgets_count_what_a_back_end_does():
    backend = make_backend("piqp")
    assert Budget.wall_clock(1.0).metered(backend) is backend
    ocp, x = random_window(2)
    budget = Budget.counted(60.0)
    optimise(ocp, x, backend, sharpness=(4.0,), iterations=1, budget=budget)
    assert budget.left_s < 60.0


class Timed(PIQPBackend):
    """Notes the time of its thread at the beginning of each QP [s]: what others do on the machine does not count."""

    def __init__(self):
        super().__init__()
        self.begun = []

    def load(self, qp, options=None):
        self.begun.append(time.thread_time())
        return super().load(qp, options)


def test_the_clock_ends_a_descent_within_a_fifth_or_one_qp():
    ocp, x = random_window(1, steps=30)
    forever = {"sharpness": np.linspace(4.0, 400.0, 400), "iterations": 10_000}
    backend, limit_s = Timed(), 0.4
    begun = time.thread_time()
    found = optimise(ocp, x, backend, budget=Budget.wall_clock(limit_s), **forever)
    took_s = time.thread_time() - begun
    assert found.feasible
    assert len(backend.begun) > 3
    assert took_s <= max(1.2 * limit_s, limit_s + np.diff(backend.begun).max())


def test_counted_work_ends_a_descent_after_the_qp_at_hand():
    ocp, x = random_window(1, steps=30)
    charges, budget = [], Budget.counted(0.05)

    class Counted(PIQPBackend):
        def solve(self, time_limit_s=None):
            charges.append(budget.left_s)
            return super().solve(time_limit_s)

    optimise(ocp, x, Counted(), sharpness=np.linspace(4.0, 400.0, 400), iterations=10_000, budget=budget)
    assert budget.exhausted
    assert len(charges) > 1
    assert min(charges) > 0.0, "no QP is begun once it is exhausted"


def task(looked_at=200):
    mission = load_mission("box-3")
    weight = np.where(np.arange(mission.field.size) < looked_at, 1.0, 0.0)[None]
    fleet = FleetConstraints.of(mission.fleet)
    return Task(fleet, mission.field.cell, weight, fleet.start, np.zeros_like(fleet.start), 0.0, 0.5)


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_plan_within_counted_work_is_the_same_again_and_keeps_to_it(backend):
    budgets = [Budget.counted(0.3) for _ in range(2)]
    first, again = (Planner(backend).thorough(task(), budget) for budget in budgets)
    assert first.feasible
    np.testing.assert_array_equal(first.plan.velocity, again.plan.velocity)
    assert 0.0 < 0.3 - budgets[0].left_s <= 0.3 + 0.3  # the stage at hand is finished
    assert budgets[0].left_s == budgets[1].left_s


@pytest.mark.parametrize("limit_s", [0.01, 0.1])
def test_a_free_horizon_is_planned_the_same_again(limit_s):
    one, two = (plan_free_horizon(task(), make_backend("piqp"), budget=Budget.counted(limit_s)) for _ in range(2))
    assert one.plan.velocity.tobytes() == two.plan.velocity.tobytes()
    assert one.kind == two.kind


def test_more_work_buys_a_plan_that_is_no_worse():
    little, much = Budget.counted(0.05), Budget.counted(3.0)
    first, second = (Planner("piqp").thorough(task(), budget) for budget in (little, much))
    assert 0.05 - little.left_s < 3.0 - much.left_s
    assert second.rank <= first.rank
