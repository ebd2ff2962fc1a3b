"""Residuals against values computed by hand."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import given
from hypothesis import strategies as st
from qp_strategies import convex_qps, qp_of

from solvers.qp import QP, SecondOrderCones
from solvers.residuals import Residuals, Tolerances, kkt_residuals

INF = np.inf
# minimise x0^2 + x0 x1 + x1^2 - x0 subject to x0 + x1 <= 1, x1 >= 0.5
QP_2 = qp_of([[2, 1], [1, 2]], [-1, 0], [[1, 1], [0, 1]], [-INF, 0.5], [1, INF])


def test_by_hand() -> None:
    found = kkt_residuals(QP_2, np.array([1.0, 0.25]), np.array([0.5, -2.0]))
    # A x = (1.25, 0.25), P x = (2.25, 1.5), A'y = (0.5, -1.5)
    assert found.primal == pytest.approx(0.25)
    assert found.dual == pytest.approx(1.75)
    # x'Px = 2.625, q'x = -1, support = 0.5 * 1 - 2 * 0.5
    assert found.gap == pytest.approx(1.125)
    assert (found.primal_scale, found.dual_scale, found.gap_scale) == pytest.approx((1.25, 2.25, 2.625))


def test_zero_at_the_solution() -> None:
    # x1 = 0.5 active: 2 x0 + 0.5 = 1, 1 + x0 + y1 = 0
    found = kkt_residuals(QP_2, np.array([0.25, 0.5]), np.array([0.0, -1.25]))
    assert max(found.primal, found.dual, found.gap) <= 1e-15


def test_multiplier_at_an_infinite_bound_is_a_dual_error() -> None:
    found = kkt_residuals(QP_2, np.array([0.25, 0.5]), np.array([-3.0, -1.25]))
    assert found.dual == pytest.approx(3.0)
    assert math.isfinite(found.gap)


def test_bounds_at_1e20_count_as_infinite() -> None:
    far = replace(QP_2, l=np.array([-1e30, 0.5]), u=np.array([1.0, 1e20]))
    x, y = np.array([1.0, 0.25]), np.array([-0.5, 2.0])
    assert kkt_residuals(far, x, y) == kkt_residuals(QP_2, x, y)


def test_without_rows() -> None:
    qp = qp_of([[2]], [-2], [], [], [])
    assert kkt_residuals(qp, np.array([3.0]), np.zeros(0)) == Residuals(0.0, 4.0, 12.0, 0.0, 6.0, 18.0)


def cone_qp() -> QP:
    """Minimise -x0 - x1 over the unit disc."""
    G = sp.csc_array(np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]))
    cones = SecondOrderCones(G, np.array([1.0, 0.0, 0.0]), (3,))
    return qp_of(np.zeros((2, 2)), [-1, -1], [], [], [], cones=cones)


def test_cones() -> None:
    root = math.sqrt(0.5)
    best, z = np.array([root, root]), np.array([math.sqrt(2), -1.0, -1.0])
    found = kkt_residuals(cone_qp(), best, np.zeros(0), z)
    assert max(found.primal, found.dual, found.gap) <= 1e-15
    outside = kkt_residuals(cone_qp(), 2.0 * best, np.zeros(0), np.array([0.0, -1.0, -1.0]))
    assert outside.primal == pytest.approx(1.0)
    assert outside.dual == pytest.approx(math.sqrt(2))  # z is outside the dual cone by that
    assert kkt_residuals(cone_qp(), best, np.zeros(0)).dual == pytest.approx(1.0)


def test_each_cone_counts() -> None:
    G = sp.csc_array(np.vstack([np.zeros((1, 2)), np.eye(2), np.array([[1.0, 0.0]])]))
    cones = SecondOrderCones(G, np.array([5.0, 0.0, 0.0, -2.0]), (3, 1))
    qp = qp_of(np.zeros((2, 2)), [0, 0], [], [], [], cones=cones)
    assert kkt_residuals(qp, np.array([1.0, 0.0]), np.zeros(0)).primal == pytest.approx(1.0)
    none = replace(qp, cones=SecondOrderCones(sp.csc_array((0, 2)), np.zeros(0), ()))
    assert kkt_residuals(none, np.array([1.0, 0.0]), np.zeros(0)).primal == 0.0


@pytest.mark.parametrize("bad", [math.nan, INF, -INF])
def test_what_is_not_finite_is_never_within(bad: float) -> None:
    everything = Tolerances(1e300, 1e300)
    x, y = np.array([0.25, 0.5]), np.array([0.0, -1.25])
    assert not kkt_residuals(QP_2, np.array([bad, 0.0]), y).within(everything)
    assert not kkt_residuals(QP_2, x, np.array([bad, 0.0])).within(everything)
    cone_x, no_y = np.zeros(2), np.zeros(0)
    assert not kkt_residuals(cone_qp(), cone_x, no_y, np.array([bad, 0.0, 0.0])).within(everything)


def test_overflow_is_no_warning_and_not_within() -> None:
    assert not kkt_residuals(QP_2, np.full(2, 1e300), np.zeros(2)).within(Tolerances(1e-6, 1e-6))


def test_relative_tolerance() -> None:
    found = Residuals(0.5, 0.0, 0.0, primal_scale=100.0)
    assert found.within(Tolerances(0.0, 0.01))
    assert not found.within(Tolerances(0.0, 0.001))
    assert found.within(Tolerances(0.5))


@pytest.mark.parametrize("bad", [-1.0, math.nan, INF])
def test_tolerances_that_mean_nothing(bad: float) -> None:
    with pytest.raises(ValueError, match="tolerance must be finite"):
        Tolerances(bad)
    with pytest.raises(ValueError, match="tolerance must be finite"):
        Tolerances(0.0, bad)


@given(convex_qps(), st.integers(0, 1000))
def test_against_the_dense_formulas(qp: QP, seed: int) -> None:
    rng = np.random.default_rng(seed)
    x, y = rng.normal(size=qp.n), rng.normal(size=qp.m)
    found = kkt_residuals(qp, x, y)
    P = qp.P.toarray()
    P = P + P.T - np.diag(np.diag(P))
    Ax = qp.A.toarray() @ x
    worst = max([0.0, *(Ax - qp.u), *(qp.l - Ax)])
    wrong = max([0.0, *(abs(y)[(y > 0) & np.isinf(qp.u)]), *(abs(y)[(y < 0) & np.isinf(qp.l)])])
    assert found.primal == pytest.approx(worst)
    assert found.dual == pytest.approx(max(wrong, abs(P @ x + qp.q + qp.A.toarray().T @ y).max()))
