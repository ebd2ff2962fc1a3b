"""The data of a QP: what is refused, and with which words."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp
from qp_strategies import qp_of

from solvers.qp import QP, InvalidQPError, SecondOrderCones

INF, NAN = np.inf, np.nan
GOOD = qp_of([[2, 1], [1, 3]], [1, 1], [[1, 0], [1, 1]], [-INF, 0], [1, INF])
UNIT = sp.csc_array(np.eye(2))
CONE = SecondOrderCones(UNIT, np.zeros(2), (2,))


def unsorted() -> sp.csc_array:
    return sp.csc_array((np.ones(2), np.array([1, 0]), np.array([0, 2, 2])), shape=(2, 2))


def duplicated() -> sp.csc_array:
    return sp.csc_array((np.ones(2), np.array([0, 0]), np.array([0, 2, 2])), shape=(2, 2))


def broken() -> sp.csc_array:
    matrix = UNIT.copy()
    matrix.indices = np.array([0, 7], dtype=np.int32)
    return matrix


def test_good_data_pass() -> None:
    GOOD.validate()
    replace(GOOD, cones=CONE).validate()
    qp_of([[0]], [1], [], [], []).validate()
    assert (GOOD.n, GOOD.m) == (2, 2)


def test_rows_may_step_back_only_where_a_column_begins() -> None:
    replace(GOOD, A=sp.csc_array(np.array([[0.0, 1.0], [1.0, 1.0]]))).validate()
    # columns without entries in between
    A = sp.csc_array(np.array([[0.0, 0.0, 0.0, 1.0], [1.0, 0.0, 0.0, 0.0]]))
    QP(sp.csc_array((4, 4)), np.zeros(4), A, np.zeros(2), np.ones(2)).validate()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"q": np.zeros(0)}, r"q: needs shape \(n,\) with n >= 1"),
        ({"q": np.zeros((2, 1))}, "q: needs shape"),
        ({"q": np.array([1, 2])}, r"q: needs float64 \(2,\), got int64"),
        ({"q": np.array([1.0, NAN])}, r"q\[1\] = nan: must be finite"),
        ({"q": np.ones(3)}, r"P: needs shape \(3, 3\), got \(2, 2\)"),
        ({"P": UNIT.tocsr()}, "P: needs a float64 csc_array, got csr_array"),
        ({"P": sp.csc_array(np.eye(2, dtype=int))}, "P: needs a float64 csc_array"),
        ({"P": sp.csc_array(np.tril(np.ones((2, 2))))}, r"P: only the upper triangle.*\(1, 0\)"),
        ({"P": sp.csc_array(np.diag([1.0, -1.0]))}, "P: not positive semi-definite"),
        ({"P": sp.csc_array(np.diag([1.0, INF]))}, r"P.data\[1\] = inf: must be finite"),
        ({"A": np.eye(2)}, "A: needs a float64 csc_array, got ndarray"),
        ({"A": sp.csc_array((2, 3))}, r"A: needs shape \(2, 2\), got \(2, 3\)"),
        ({"A": unsorted()}, "A: row indices must increase"),
        ({"A": duplicated()}, "A: row indices must increase"),
        ({"A": broken()}, "A: "),
        ({"A": sp.csc_array(np.full((2, 2), NAN))}, r"A.data\[0\] = nan"),
        ({"l": np.zeros((2, 1))}, r"l: needs shape \(m,\)"),
        ({"l": np.zeros(3)}, "A: needs shape"),
        ({"u": np.zeros(3)}, r"u: needs float64 \(2,\)"),
        ({"u": [1.0, 1.0]}, r"u: needs float64 \(2,\), got list"),
        ({"u": np.array([1.0, NAN])}, r"u\[1\] = nan"),
        ({"u": np.array([1.0, -INF])}, r"u\[1\] = -inf: no finite value"),
        ({"l": np.array([INF, 0.0])}, r"l\[0\] = inf: no finite value"),
        ({"u": np.array([1.0, -0.5])}, r"row 1: l\[1\] = 0.0 is above u\[1\] = -0.5"),
        ({"cones": SecondOrderCones(UNIT, np.zeros(2), (2, 0))}, "cones.sizes: every cone"),
        ({"cones": SecondOrderCones(UNIT, np.zeros(2), (3,))}, r"cones.G: needs shape \(3, 2\)"),
        ({"cones": SecondOrderCones(UNIT, np.zeros(3), (2,))}, r"cones.h: needs float64 \(2,\)"),
        ({"cones": SecondOrderCones(UNIT, np.array([0.0, INF]), (2,))}, r"cones.h\[1\] = inf"),
    ],
)
def test_bad_data_are_named(change: dict, message: str) -> None:
    with pytest.raises(InvalidQPError, match=message):
        replace(GOOD, **change).validate()


def test_own_copy_is_independent_and_opened_up() -> None:
    qp = replace(GOOD, l=np.array([-1e25, 0.0]), u=np.array([1.0, 1e20]))
    own = qp.own_copy()
    assert own.l[0] == -INF
    assert own.u[1] == INF
    for mine, theirs in ((own.q, qp.q), (own.P.data, qp.P.data), (own.A.data, qp.A.data)):
        assert not np.shares_memory(mine, theirs)
    assert qp.l[0] == -1e25


def test_same_pattern() -> None:
    assert GOOD.same_pattern(replace(GOOD, q=np.zeros(2), l=np.full(2, -INF)))
    assert not GOOD.same_pattern(replace(GOOD, A=UNIT))
    assert not GOOD.same_pattern(replace(GOOD, P=UNIT))
    assert not GOOD.same_pattern(replace(GOOD, cones=CONE))
