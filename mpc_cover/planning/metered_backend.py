"""A back-end whose work is counted: what a QP costs is known from its size and iterations, the same every time."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, cast

if TYPE_CHECKING:
    from collections.abc import Callable

    from solvers.backends.base import Backend
    from solvers.solution import QPSolution

_ASSEMBLY_S = 1.0e-6
"""Seconds that building a QP and judging its answer take, for each entry of its matrix.

Measured on box-3's plan on two cores at 2.5 GHz or so; what iterations take is for the back-end to say."""


class _Metered:
    """Is the back-end that it wraps, but that it counts; limits on time are left to whoever counts."""

    def __init__(self, inner: Backend, charge: Callable[[float], None]) -> None:
        self._inner, self._charge = inner, charge

    def __getattr__(self, name: str) -> Any:
        return getattr(self._inner, name)

    def solve(self, time_limit_s: float | None = None) -> QPSolution:
        """Solve, see `Backend.solve`, and count what it cost."""
        del time_limit_s  # a limit by the clock would make the result another one every time
        solution = self._inner.solve()
        each_s = _ASSEMBLY_S + self._inner.capabilities.entry_iteration_s * solution.iterations
        self._charge(each_s * self._inner.qp.A.nnz)
        return solution


def metered(backend: Backend, charge: Callable[[float], None]) -> Backend:
    """Return the back-end; what each QP costs [s] is told to `charge`."""
    return cast("Backend", _Metered(backend, charge))
