"""The interior-point descent: it judges motions as NumPy does, never makes one worse, and keeps what is given."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as examples
from hypothesis import strategies as st
from motions import UNLIMITED, random_window

from mpc_cover.constraints.boundary import BoundaryConditions
from mpc_cover.mission.load import load_mission
from mpc_cover.model.fleet_constraints import FleetConstraints
from mpc_cover.model.look_instants import LookInstants
from mpc_cover.planning import interior_point
from mpc_cover.planning.budget import Budget
from mpc_cover.planning.offline import offline_task
from mpc_cover.planning.scp import evaluate, evaluate_with_numpy, optimise
from mpc_cover.verification.motion import verify_motion
from solvers.backends.registry import make_backend
from solvers.native import library

built = pytest.mark.skipif(library.library() is None, reason="there was no C compiler when the package was built")
pytestmark = built

NATIVE = make_backend("native")
CHANGES = (
    {},
    {"reaction_periods": 1.5},
    {"reaction_periods": 2.0, "lost": (1,)},
    {"links": ((0, 2),)},
    {"look_instants": LookInstants(per_step=4)},
    {"look_instants": LookInstants(continuous=True)},
    {"communication_range": math.inf},
    {"separation_min": 0.0},
)


def window(seed, change, *, looks=False, dimension=2, steps=7):
    ocp, x = random_window(seed, steps=steps, dimension=dimension)
    fleet = FleetConstraints.of(ocp.fleet, **change)
    if fleet.lost:
        fleet = replace(fleet, radius=np.where(fleet.is_active[:, None], fleet.radius, -np.inf))
    changed = replace(ocp, fleet=fleet)
    if looks:
        counts = np.random.default_rng(seed).integers(1, 4, ocp.weight.shape)
        changed = replace(changed, looks=counts)
    return changed, changed.exact_ends(x)


def shaken(ocp, x, seed, size):
    rng = np.random.default_rng(seed)
    return ocp.exact_ends(x + size * rng.normal(size=x.size))


@examples(deadline=None, max_examples=60)
@given(
    seed=st.integers(0, 40),
    change=st.sampled_from(CHANGES),
    looks=st.booleans(),
    dimension=st.sampled_from([2, 3]),
    size=st.sampled_from([0.0, 0.05, 0.5]),
    steps=st.sampled_from([7, 50]),  # samples are bounded together by sixteen steps
)
def test_motions_are_judged_as_numpy_judges_them(seed, change, looks, dimension, size, steps):
    ocp, x = window(seed, change, looks=looks, dimension=dimension, steps=steps)
    x = shaken(ocp, x, seed, size)
    one, other = interior_point.evaluate(ocp, x), evaluate_with_numpy(ocp, x)
    # nearest points of continuous looks are refined from different points of an interval
    exact = 1e-2 if ocp.fleet.look_instants.continuous else 1e-9
    assert one.cost == pytest.approx(other.cost, rel=exact, abs=1e-9)
    assert one.violation == pytest.approx(other.violation, abs=1e-9)
    assert one.braking_violation == pytest.approx(other.braking_violation, abs=1e-9)


@examples(deadline=None, max_examples=40)
@given(
    seed=st.integers(0, 40),
    change=st.sampled_from(CHANGES),
    looks=st.booleans(),
    size=st.sampled_from([0.0, 0.2]),
)
def test_a_descent_is_never_worse_and_passes_the_independent_verifier(seed, change, looks, size):
    ocp, x = window(seed, change, looks=looks)
    x = shaken(ocp, x, seed, size)
    before, after = evaluate(ocp, x), optimise(ocp, x, NATIVE, budget=UNLIMITED)
    now = evaluate(ocp, after.x)
    if before.feasible:
        assert now.feasible
        assert now.merit <= before.merit
    if not now.feasible:
        return
    position, velocity = ocp.motion(after.x)
    force, time = np.diff(velocity, axis=0) / ocp.period, ocp.period * np.arange(ocp.steps + 1)
    report = verify_motion(ocp.fleet, time, position, velocity, force, at_rest=True)
    assert report.holds, report.first_failure


def test_a_descent_covers_much_more_than_its_guess():
    gains = []
    for seed in range(10):
        ocp, x = random_window(seed, steps=12)
        gains.append(evaluate_with_numpy(ocp, x).cost / optimise(ocp, x, NATIVE, budget=UNLIMITED).cost)
    assert np.median(gains) > 1.3


@pytest.mark.parametrize("closed", [False, True])
def test_free_fixed_and_closed_ends_are_kept(closed):
    ocp, x = random_window(2, steps=10)
    start = ocp.fleet.start
    ends = (
        BoundaryConditions(closed=True)
        if closed
        else BoundaryConditions(
            start_position=start,
            start_velocity=np.zeros_like(start),
            end_position=start + 0.2,
            end_velocity=np.zeros_like(start),
        )
    )
    ocp = replace(ocp, ends=ends)
    after = optimise(ocp, ocp.exact_ends(x), NATIVE, budget=UNLIMITED)
    position, velocity = ocp.motion(after.x)
    assert after.feasible
    target = position[0] if closed else start + 0.2
    np.testing.assert_allclose(position[-1], target, atol=1e-9)
    np.testing.assert_allclose(velocity[-1], velocity[0], atol=1e-12)
    assert after.cost < evaluate_with_numpy(ocp, ocp.exact_ends(x)).cost


def test_lost_agents_stay_where_they_are():
    ocp, x = window(3, {"lost": (1,)}, steps=10)
    position, velocity = ocp.motion(optimise(ocp, x, NATIVE, budget=UNLIMITED).x)
    assert not velocity[:, 1].any()
    np.testing.assert_array_equal(position[:, 1], np.broadcast_to(position[0, 1], position[:, 1].shape))


@examples(deadline=None, max_examples=10)
@given(seed=st.integers(0, 40), moved=st.floats(-50.0, 50.0))
def test_what_is_moved_and_renumbered_descends_alike(seed, moved):
    ocp, x = random_window(seed, steps=8)
    fleet, order = ocp.fleet, [2, 0, 1]
    start, still = fleet.start[order] + moved, np.zeros_like(fleet.start)
    walls = {"motion_min": fleet.motion_min + moved, "motion_max": fleet.motion_max + moved}
    other = replace(
        ocp,
        fleet=replace(fleet, start=start, **walls),
        cell=ocp.cell + moved,
        ends=BoundaryConditions(start, still, None, still),
    )
    position, velocity = ocp.motion(x)
    y = other.decision(position[0][order] + moved, velocity[:, order])
    one = optimise(ocp, x, NATIVE, budget=UNLIMITED, sharpness=(4.0,), iterations=1)
    two = optimise(other, y, NATIVE, budget=UNLIMITED, sharpness=(4.0,), iterations=1)
    assert two.cost == pytest.approx(one.cost, rel=1e-4)


def test_counted_work_is_charged_bounds_the_descent_and_is_reproducible():
    task = offline_task(load_mission("box-3"))
    ocp = task.ocp(30)
    x = ocp.decision(task.position, np.zeros((31, 3, 2)))
    budget = Budget.counted(1.0)
    full = optimise(ocp, x, NATIVE, budget=budget)
    spent = 1.0 - budget.left_s
    assert 1e-3 < spent < 0.5
    tight = Budget.counted(0.25 * spent)
    short = optimise(ocp, x, NATIVE, budget=tight)
    assert sum(stage.iterations for stage in short.stages) < sum(stage.iterations for stage in full.stages)
    again = optimise(ocp, x, NATIVE, budget=Budget.counted(1.0))
    np.testing.assert_array_equal(again.x, full.x)


def test_a_deadline_ends_a_descent():
    ocp, x = random_window(5, steps=60)
    result = optimise(ocp, x, NATIVE, budget=Budget.wall_clock(1e-3))
    assert sum(stage.iterations for stage in result.stages) < 60


def test_without_the_library_the_sqp_takes_its_place(monkeypatch):
    ocp, x = random_window(4)
    monkeypatch.setattr(library, "library", lambda: None)
    result = optimise(ocp, x, NATIVE, budget=UNLIMITED, sharpness=(4.0,), iterations=2)
    assert result.feasible
    assert all(step.qp_iterations > 0 for stage in result.stages for step in stage.history)
