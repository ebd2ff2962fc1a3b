"""CVXPY's statuses, in the groups that matter, and its warnings."""

from __future__ import annotations

import warnings
from contextlib import contextmanager
from typing import TYPE_CHECKING

import cvxpy as cp

if TYPE_CHECKING:
    from collections.abc import Iterator

USABLE = frozenset({cp.OPTIMAL, cp.OPTIMAL_INACCURATE})
"""Statuses with a solution that is a candidate."""
INFEASIBLE = frozenset({cp.INFEASIBLE, cp.INFEASIBLE_INACCURATE, "infeasible_or_unbounded"})
"""Statuses that say that no point keeps the constraints."""
UNBOUNDED = frozenset({cp.UNBOUNDED, cp.UNBOUNDED_INACCURATE})
"""Statuses that say that the objective has no lower bound."""


@contextmanager
def quiet() -> Iterator[None]:
    """Ignore CVXPY's warnings on accuracy and speed, which are no news to whoever looks at the status."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield
