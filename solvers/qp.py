"""The data of a convex QP with optional second-order cones.

    minimise    1/2 x'Px + q'x
    subject to  l <= A x <= u,   h + G x in K

K is a product of second-order cones {(t, v): ||v||_2 <= t}. The QP of Appendix A of the thesis is the
case without cones, with W_k for P.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy

from solvers.checks import (
    INFINITE,
    InvalidQPError,
    check_bounds,
    check_diagonal,
    check_finite,
    check_matrix,
    column_of_each_entry,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray


__all__ = ["INFINITE", "QP", "InvalidQPError", "SecondOrderCones"]


@dataclass(frozen=True)
class SecondOrderCones:
    """The constraint h + G x in K, K = K_1 x K_2 x ..., K_i = {(t, v): ||v||_2 <= t} in R^sizes[i].

    Attributes
    ----------
    G: (k, n), canonical csc.
    h: (k,).
    sizes: dimensions of the cones; they sum to k.
    """

    G: scipy.sparse.csc_array[np.float64]
    h: NDArray[np.float64]
    sizes: tuple[int, ...]

    def validate(self, n: int) -> None:
        """Raise `InvalidQPError` unless the cones are well formed for `n` variables."""
        if any(size < 1 for size in self.sizes):
            raise InvalidQPError(f"cones.sizes: every cone needs at least one row, got {self.sizes}")
        rows = sum(self.sizes)
        check_matrix("cones.G", self.G, (rows, n))
        check_finite("cones.h", self.h, rows)


@dataclass(frozen=True)
class QP:
    """A convex QP. Arrays are neither copied nor converted; `validate` checks them.

    Attributes
    ----------
    P: (n, n), canonical csc, upper triangle with the diagonal; positive semi-definite is the caller's
        responsibility (only a negative diagonal is detected).
    q: (n,), finite.
    A: (m, n), canonical csc; m = 0 is fine.
    l, u: (m,), l <= u, infinite where there is no bound (see `INFINITE`).
    cones: second-order cones, or None.
    """

    P: scipy.sparse.csc_array[np.float64]
    q: NDArray[np.float64]
    A: scipy.sparse.csc_array[np.float64]
    l: NDArray[np.float64]  # noqa: E741 - the field's own letter
    u: NDArray[np.float64]
    cones: SecondOrderCones | None = None

    @property
    def n(self) -> int:
        """Number of variables."""
        return int(self.q.shape[0])

    @property
    def m(self) -> int:
        """Number of rows of A."""
        return int(self.l.shape[0])

    def validate(self) -> None:
        """Raise `InvalidQPError`, naming the field, unless the data are valid for every back-end."""
        if self.q.ndim != 1 or self.n == 0:
            raise InvalidQPError(f"q: needs shape (n,) with n >= 1, got {self.q.shape}")
        if self.l.ndim != 1:
            raise InvalidQPError(f"l: needs shape (m,), got {self.l.shape}")
        check_finite("q", self.q, self.n)
        check_matrix("P", self.P, (self.n, self.n))
        columns = column_of_each_entry(self.P)
        if (below := np.flatnonzero(self.P.indices > columns)).size:
            row, column = self.P.indices[below[0]], columns[below[0]]
            raise InvalidQPError(f"P: only the upper triangle is stored, but there is an entry ({row}, {column})")
        check_diagonal(self.P.data, np.flatnonzero(self.P.indices == columns))
        check_matrix("A", self.A, (self.m, self.n))
        check_bounds(self.l, self.u, self.m)
        if self.cones is not None:
            self.cones.validate(self.n)

    def same_pattern(self, other: QP) -> bool:
        """Return whether the other problem differs only in the values of P, q, A, l and u."""
        return self.cones is other.cones and all(
            one.shape == two.shape
            and np.array_equal(one.indptr, two.indptr)
            and np.array_equal(one.indices, two.indices)
            for one, two in ((self.P, other.P), (self.A, other.A))
        )

    def own_copy(self) -> QP:
        """Return a copy of the values with normalised bounds; the sparsity pattern is shared."""
        P = scipy.sparse.csc_array((self.P.data.copy(), self.P.indices, self.P.indptr), shape=self.P.shape)
        A = scipy.sparse.csc_array((self.A.data.copy(), self.A.indices, self.A.indptr), shape=self.A.shape)
        own = QP(P, self.q.copy(), A, self.l.copy(), self.u.copy(), self.cones)
        own.normalise_bounds()
        return own

    def normalise_bounds(self) -> None:
        """Replace bounds of magnitude `INFINITE` or more by infinity in place, so that all back-ends see the same."""
        self.l[self.l <= -INFINITE] = -np.inf
        self.u[self.u >= INFINITE] = np.inf
