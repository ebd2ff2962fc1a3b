"""Positive definiteness whatever comes, and the secant equation where it can hold."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from quasi_newton import damped_bfgs, nearest_positive

seeds = st.integers(0, 10_000)


@given(seeds, st.integers(1, 5), st.floats(-3.0, 3.0))
def test_stays_positive_definite(seed: int, n: int, curvature: float) -> None:
    rng = np.random.default_rng(seed)
    B = None
    for _ in range(5):
        step = rng.normal(size=n)
        B = damped_bfgs(B, step, curvature * step + 0.1 * rng.normal(size=n))
        np.testing.assert_array_equal(B, B.T)
        assert np.linalg.eigvalsh(B).min() > 0.0


@given(seeds)
def test_secant_equation_where_the_curvature_is_good(seed: int) -> None:
    rng = np.random.default_rng(seed)
    step = rng.normal(size=3)
    change = step * rng.uniform(0.5, 2.0, 3)
    assert damped_bfgs(np.eye(3), step, change) @ step == pytest.approx(change)


def test_damping_by_hand() -> None:
    # curvature -1, sBs = 1: theta = 0.8 / 2 = 0.4, r = 0.4 * -1 + 0.6 * 1 = 0.2
    assert damped_bfgs(np.eye(1), np.ones(1), -np.ones(1)) == pytest.approx(np.array([[0.2]]))


def test_nothing_is_learnt_from_nothing() -> None:
    B = 2.0 * np.eye(2)
    assert damped_bfgs(B, np.zeros(2), np.ones(2)) is B
    assert damped_bfgs(B, np.ones(2), np.array([np.nan, 1.0])) is B


def test_nearest_positive() -> None:
    good = np.array([[2.0, 1.0], [1.0, 2.0]])
    assert nearest_positive(good) == pytest.approx(good)
    raised = nearest_positive(np.diag([-5.0, 3.0]))
    assert raised == pytest.approx(np.diag([0.0, 3.0]), abs=1e-6)
    assert np.linalg.eigvalsh(raised).min() > 0.0


def test_what_is_not_finite_is_left_for_others_to_name() -> None:
    assert np.isnan(nearest_positive(np.array([[np.nan]]))).all()
