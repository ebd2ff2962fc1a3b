"""Hypothesis: strictly convex QPs that have a solution, with every kind of row."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from hypothesis import strategies as st

from solvers.qp import QP


def qp_of(P: object, q: object, A: object, lower: object, upper: object, **more: object) -> QP:
    """Return the QP of dense data; P may be full."""
    return QP(
        sp.csc_array(np.triu(np.array(P, dtype=float))),
        np.array(q, dtype=float),
        sp.csc_array(np.array(A, dtype=float).reshape(-1, len(np.array(q)))),
        np.array(lower, dtype=float),
        np.array(upper, dtype=float),
        **more,  # type: ignore[arg-type]
    )


def random_qp(seed: int, n: int, m: int, kinds: list[str]) -> QP:
    """Return a QP with a point inside its bounds; the pattern depends on n, m and not on the values."""
    rng = np.random.default_rng(seed)
    root = rng.uniform(-1.0, 1.0, (n, n))
    A = rng.uniform(-1.0, 1.0, (m, n))
    at = A @ rng.uniform(-1.0, 1.0, n)
    below, above = rng.uniform(0.0, 1.0, m), rng.uniform(0.0, 1.0, m)
    lower, upper = at - below, at + above
    for row, kind in enumerate(kinds):
        if kind in {"upper", "free"}:
            lower[row] = -np.inf
        if kind in {"lower", "free"}:
            upper[row] = np.inf
        if kind == "equal":
            lower[row] = upper[row] = at[row]
    return qp_of(root @ root.T + np.eye(n), rng.uniform(-3.0, 3.0, n), A, lower, upper)


@st.composite
def kinds_of_rows(draw: st.DrawFn, n: int) -> list[str]:
    """Rows of every kind, with fewer equalities than variables."""
    kinds = draw(st.lists(st.sampled_from(["both", "upper", "lower", "free"]), max_size=5))
    equalities = draw(st.integers(0, min(2, n - 1)))
    return draw(st.permutations(kinds + ["equal"] * equalities))


@st.composite
def convex_qps(draw: st.DrawFn) -> QP:
    """One QP."""
    n = draw(st.integers(1, 5))
    kinds = draw(kinds_of_rows(n))
    return random_qp(draw(st.integers(0, 10_000)), n, len(kinds), kinds)


@st.composite
def pairs_of_qps(draw: st.DrawFn) -> tuple[QP, QP]:
    """Two QPs of the same pattern; their rows may be of different kinds."""
    n = draw(st.integers(1, 5))
    kinds = draw(kinds_of_rows(n))
    seeds = draw(st.tuples(st.integers(0, 10_000), st.integers(0, 10_000)))
    other = draw(st.permutations(kinds))
    return random_qp(seeds[0], n, len(kinds), kinds), random_qp(seeds[1], n, len(kinds), other)
