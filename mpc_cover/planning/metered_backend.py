"""A QP back-end whose work is counted: its cost follows from its size and iterations alone."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, cast

if TYPE_CHECKING:
    from collections.abc import Callable

    from solvers.backends.base import Backend
    from solvers.solution import QPSolution

_ASSEMBLY_S = 1.0e-6
"""Seconds per stored entry of A that assembling a QP and evaluating its solution take.

Measured on the plan of box-3 on two cores at about 2.5 GHz; the time of iterations is a capability of the back-end."""


class _Metered:
    """A back-end that charges for each solve and delegates everything else to the one that it wraps."""

    def __init__(self, inner: Backend, charge: Callable[[float], None]) -> None:
        self._inner, self._charge = inner, charge

    def __getattr__(self, name: str) -> Any:
        return getattr(self._inner, name)

    def solve(self, time_limit_s: float | None = None) -> QPSolution:
        """Solve, see `Backend.solve`, and charge what it cost."""
        del time_limit_s  # a wall-clock limit would make the result irreproducible
        solution = self._inner.solve()
        self._charge((_ASSEMBLY_S + solution.work_per_entry_s) * self._inner.qp.A.nnz)
        return solution


def metered(backend: Backend, charge: Callable[[float], None]) -> Backend:
    """Return the back-end with a `charge` callback for the cost of each QP [s]."""
    return cast("Backend", _Metered(backend, charge))
