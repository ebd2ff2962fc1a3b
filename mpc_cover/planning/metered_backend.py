"""A back-end whose work is counted: what a QP costs is known from its size and iterations, the same every time."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, cast

if TYPE_CHECKING:
    from mpc_cover.planning.budget import Meter
    from solvers.backends.base import Backend
    from solvers.qp import QPSolution

_ASSEMBLY_S = 1.0e-6
"""Seconds that building a QP and judging its answer take, for each entry of its matrix.

Measured on box-3's plan on two cores at 2.5 GHz or so; what iterations take is for the back-end to say."""


class _Metered:
    """Is the back-end that it wraps, but that it counts; no limit on time that is infinite reaches it."""

    def __init__(self, inner: Backend, meter: Meter) -> None:
        self._inner, self._meter = inner, meter

    def __getattr__(self, name: str) -> Any:
        return getattr(self._inner, name)

    def solve(self, time_limit_s: float | None = None) -> QPSolution:
        """Solve, see `Backend.solve`, and count what it cost."""
        endless = time_limit_s is None or math.isinf(time_limit_s)
        solution = self._inner.solve(None if endless else time_limit_s)
        each_s = _ASSEMBLY_S + self._inner.capabilities.entry_iteration_s * solution.iterations
        self._meter.spent_s += each_s * self._inner.qp.A.nnz
        return solution


def metered(backend: Backend, meter: Meter) -> Backend:
    """Return the back-end with its work counted."""
    return cast("Backend", _Metered(backend, meter))
