"""Majorise-minimise: J_beta goes down, constraints hold, and it may be stopped at any time."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st
from motions import EXHAUSTED, UNLIMITED, random_window, replace

from mpc_cover.coverage.majoriser import soft_minimum
from mpc_cover.planning.scp import evaluate, optimise, optimise_without_margin, softness_at
from mpc_cover.verification.motion import verify_motion
from solvers.backends.capabilities import Capabilities
from solvers.backends.piqp_ import PIQPBackend
from solvers.backends.registry import make_backend


@hypothesis_settings(max_examples=15)
@given(seed=st.integers(0, 10**4))
def test_what_it_returns_is_no_worse_and_passes_the_independent_verifier(seed):
    ocp, x = random_window(seed)
    before = evaluate(ocp, x)
    after = optimise(ocp, x, make_backend("piqp"), sharpness=(4.0, 20.0), iterations=3, budget=UNLIMITED)
    assert before.feasible
    assert after.feasible
    assert after.cost <= before.cost
    position, velocity = ocp.motion(after.x)
    period = ocp.period
    force = np.diff(velocity, axis=0) / period
    report = verify_motion(ocp.fleet, period * np.arange(ocp.steps + 1), position, velocity, force, at_rest=True)
    assert report.holds, report.first_failure


def test_an_exhausted_budget_returns_the_start():
    ocp, x = random_window(1)
    result = optimise(ocp, x, make_backend("piqp"), budget=EXHAUSTED)
    assert result.x.tolist() == x.tolist()
    assert result.stages == ()


class Unheard(PIQPBackend):
    """A back-end that no planner has heard of; it keeps the tolerances that it is asked for."""

    name = "unheard"
    capabilities = Capabilities(
        second_order_cones=False, inexact=3e-3, fine=2e-4, accurate=1e-8, entry_iteration_s=2.5e-7
    )

    def __init__(self):
        super().__init__()
        self.asked = []

    def load(self, qp, options=None):
        self.asked.append(options.tolerance)
        return super().load(qp, options)


def test_tolerances_are_those_that_the_back_end_declares_whatever_its_name():
    (ocp, x), backend = random_window(1), Unheard()
    begun = optimise(ocp, x, backend, sharpness=(4.0,), iterations=2, budget=UNLIMITED)
    assert set(backend.asked) == {3e-3}
    backend.asked.clear()
    sharp = optimise(ocp, begun.x, backend, sharpness=(40.0,), iterations=2, budget=UNLIMITED)
    assert set(backend.asked) == {2e-4}
    backend.asked.clear()
    optimise_without_margin(ocp, sharp, backend, budget=UNLIMITED)
    assert set(backend.asked) == {1e-8}


def test_the_margin_makes_up_for_the_soft_minimum_of_two_equally_near_samples():
    for sharpness in (1.0, 4.0, 100.0):
        softness = softness_at(sharpness, 2.0)
        assert softness.beta == pytest.approx(sharpness / 2.0)
        value, _ = soft_minimum(np.array([[0.0, 0.0]]), softness.beta)
        assert -value[0] == pytest.approx(softness.margin, rel=0.02)


@pytest.mark.parametrize("backend", ["piqp", "clarabel", "osqp"])
def test_plans_along_the_walls_stay_inside_between_samples_too(backend):
    """Cells up to the edge of a box that is hardly wider than the sensing disc pull the agent to the walls."""
    ocp, x = random_window(5, steps=12, agents=1)
    fleet = replace(ocp.fleet, radius=np.array([[0.3]]))
    ocp = replace(ocp, fleet=fleet)
    found = optimise(ocp, x, make_backend(backend), sharpness=(4.0, 20.0), iterations=6, budget=UNLIMITED)
    position, velocity = ocp.motion(found.x)
    force = np.diff(velocity, axis=0) / ocp.period
    report = verify_motion(fleet, ocp.period * np.arange(13), position, velocity, force, at_rest=True)
    assert found.feasible
    assert report.holds, report.first_failure
