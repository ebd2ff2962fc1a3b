"""Majorise-minimise: J_beta goes down, constraints hold, and it may be stopped at any time."""

from __future__ import annotations

import time
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st
from motions import random_window, settings

from mpc_cover.planning.continuation import FEASIBILITY, judge, refine, softness_at
from mpc_cover.planning.problem import CoverageProblem
from mpc_cover.verification.motion import verify_motion
from solvers import sqp
from solvers.backends.registry import make_backend


@hypothesis_settings(max_examples=15)
@given(seed=st.integers(0, 10**4), backend=st.sampled_from(["piqp", "osqp", "clarabel"]))
def test_j_beta_never_rises_from_one_accepted_iterate_to_the_next(seed, backend):
    window, x = random_window(seed)
    problem = CoverageProblem(window, settings())
    first = problem.measure(x)
    result = sqp.solve(problem, x, make_backend(backend), sqp.Options(max_iterations=5, feasibility=FEASIBILITY))
    values = [first.merit(50.0), *(it.objective for it in result.history)]
    assert all(later <= earlier + 1e-9 for earlier, later in pairwise(values))
    assert result.violation <= FEASIBILITY


@hypothesis_settings(max_examples=15)
@given(seed=st.integers(0, 10**4))
def test_what_it_returns_is_no_worse_and_passes_the_independent_verifier(seed):
    window, x = random_window(seed)
    before = judge(window, x)
    after = refine(window, x, make_backend("piqp"), sharpness=(4.0, 20.0), iterations=3)
    assert before.feasible
    assert after.feasible
    assert after.cost <= before.cost
    position, velocity = window.motion(after.x)
    period = window.period
    force = np.diff(velocity, axis=0) / period
    report = verify_motion(window.fleet, period * np.arange(window.steps + 1), position, velocity, force, at_rest=True)
    assert report.holds, report.first_failure


def test_a_deadline_that_has_passed_returns_the_start():
    window, x = random_window(1)
    result = refine(window, x, make_backend("piqp"), deadline=time.perf_counter() - 1.0)
    assert result.x.tolist() == x.tolist()
    assert result.stages == ()


def test_the_margin_makes_up_for_the_soft_minimum_and_never_vanishes():
    assert softness_at(4.0, 2.0).beta == pytest.approx(2.0)
    assert softness_at(4.0, 2.0).margin == pytest.approx(0.35)
    assert softness_at(1e6, 2.0).margin == pytest.approx(0.04)
