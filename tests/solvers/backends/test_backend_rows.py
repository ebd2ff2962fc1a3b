"""Rows by kind, and stacks of rows."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import given
from hypothesis import strategies as st

from solvers.backends.rows import EQUAL, LOWER, UPPER, Block, native_csc, row_kinds, stack_rows

INF = np.inf


def test_kinds() -> None:
    kinds = row_kinds(np.array([0.0, -INF, 0.0, -INF, 2.0]), np.array([1.0, 1.0, INF, INF, 2.0]))
    assert kinds.tolist() == [UPPER + LOWER, UPPER, LOWER, 0, EQUAL]


@given(st.integers(0, 10_000), st.integers(0, 6), st.integers(1, 6))
def test_stack_is_what_numpy_says(seed: int, m: int, n: int) -> None:
    rng = np.random.default_rng(seed)
    one = sp.csc_array(rng.normal(size=(m, n)) * rng.integers(0, 2, (m, n)))
    two = sp.csc_array(rng.normal(size=(2, n)))
    first, second = (np.flatnonzero(rng.integers(0, 2, m)) for _ in range(2))
    blocks = [Block(one, first, 1.0), Block(one, second, -1.0), Block(two, np.arange(2), -1.0, one.nnz)]

    def wanted() -> np.ndarray:
        dense = one.toarray()
        return np.vstack((dense[first], -dense[second], -two.toarray()))

    stack = stack_rows(blocks, np.concatenate((one.data, two.data)))
    assert stack.matrix.has_canonical_format
    np.testing.assert_array_equal(stack.matrix.toarray(), wanted())
    one.data = rng.normal(size=one.nnz)
    stack.refresh(np.concatenate((one.data, two.data)))
    np.testing.assert_array_equal(stack.matrix.toarray(), wanted())


def test_native_matrix_shares_its_data() -> None:
    matrix = sp.csc_array((np.ones(2), np.array([0, 1], np.int64), np.array([0, 1, 2], np.int64)), shape=(2, 2))
    native = native_csc(matrix)
    assert native.indices.dtype == native.indptr.dtype == np.int32
    assert np.shares_memory(native.data, matrix.data)
    matrix.data[0] = 5.0
    assert native.toarray() == pytest.approx(np.diag([5.0, 1.0]))
