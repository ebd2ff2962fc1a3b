"""OSQP: operator splitting; low accuracy is cheap and it can be warm-started.

Workarounds (osqp 1.1.3): an unknown keyword of `update` is silently ignored (its names are Px, Ax,
q, l, u); the rejection of a matrix by `update` shows only in its printed output, and the next solve is then wrong;
`update` writes into the matrices given to `setup`; infeasible problems come with a finite x (the
bits of a NaN read as an integer, 2143289344.0); the time limit leaves out everything before `solve`, but
counts the set-up against it. The base class rejects l > u and NaN, after which OSQP would keep the old
bounds or a corrupt warm start.
"""

from __future__ import annotations

import contextlib
import io
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, ClassVar, final

import numpy as np
import osqp

from solvers.backends.base import Backend, Options, RawSolution
from solvers.backends.capabilities import Capabilities
from solvers.backends.rows import native_csc
from solvers.status import Status

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from numpy.typing import NDArray

    from solvers.qp import QP

MAX_ITERATIONS = 10_000
"""A plain choice, 2.5 times OSQP's default."""
NO_LIMIT_S = 1e10
"""OSQP's own default time limit [s]."""

CAPABILITIES = Capabilities(
    second_order_cones=False,
    inexact=1e-3,
    fine=1e-3,
    accurate=1e-5,
    entry_iteration_s=5.7e-9,
    variables_max=180_000,
)
"""Measured as in `capabilities`. Mean J of the refined plans, by tolerance: 1e-2 5.25 m, 1e-3 4.99 m, 1e-4 4.97 m,
1e-6 4.98 m; in 0.36, 0.83, 1.34, 8.35 s. All of 65 accurate QPs are solved to 1e-5, 68 of 72 to 1e-6, in 1.5 and
4.0 s. An iteration takes 4.7e-9 to 8.2e-9 s an entry.
QPs of up to 182,043 variables were set up in 3 s."""

STATUS: Mapping[str, Status] = MappingProxyType(
    {
        "OSQP_SOLVED": Status.SOLVED,
        "OSQP_SOLVED_INACCURATE": Status.INACCURATE,
        "OSQP_PRIMAL_INFEASIBLE": Status.PRIMAL_INFEASIBLE,
        "OSQP_PRIMAL_INFEASIBLE_INACCURATE": Status.PRIMAL_INFEASIBLE,
        "OSQP_DUAL_INFEASIBLE": Status.DUAL_INFEASIBLE,
        "OSQP_DUAL_INFEASIBLE_INACCURATE": Status.DUAL_INFEASIBLE,
        "OSQP_MAX_ITER_REACHED": Status.MAX_ITERATIONS,
        "OSQP_TIME_LIMIT_REACHED": Status.TIME_LIMIT,
        "OSQP_NON_CVX": Status.NON_CONVEX,
        "OSQP_SIGINT": Status.INTERRUPTED,
        "OSQP_UNSOLVED": Status.UNKNOWN,
    }
)
NAMES = {int(member): member.name for member in osqp.SolverStatus}
WITHOUT_X = frozenset({Status.PRIMAL_INFEASIBLE, Status.DUAL_INFEASIBLE, Status.NON_CONVEX})


class OSQPRefusalError(RuntimeError):
    """The output of OSQP when it rejects its data, for example because P is not positive semi-definite."""


@final
class OSQPBackend(Backend):
    """OSQP with its direct, single-threaded linear solver (QDLDL)."""

    name: ClassVar[str] = "osqp"
    capabilities: ClassVar[Capabilities] = CAPABILITIES

    _native: Any = None
    _native_limit_s = NO_LIMIT_S
    _counted_s = 0.0  # time that OSQP will count against the limit of the next solve

    def _setup(self, qp: QP, options: Options) -> None:
        begun = self._clock()
        native = osqp.OSQP(algebra="builtin")
        with contextlib.nullcontext() if options.verbose else _printed_errors():
            native.setup(
                native_csc(qp.P),
                qp.q,
                native_csc(qp.A),
                qp.l,
                qp.u,
                verbose=options.verbose,
                eps_abs=options.tolerance,
                eps_rel=options.tolerance,
                max_iter=options.max_iterations or MAX_ITERATIONS,
            )
        self._native, self._native_limit_s = native, NO_LIMIT_S
        self._counted_s = self._clock() - begun

    def _update(self, qp: QP, changed: frozenset[str]) -> bool:
        begun = self._clock()
        if vectors := {name: getattr(qp, name) for name in sorted(changed & {"q", "l", "u"})}:
            # both bounds at once: one of them alone might cross the other's old value
            if not vectors.keys().isdisjoint({"l", "u"}):
                vectors |= {"l": qp.l, "u": qp.u}
            self._native.update(**vectors)
        if matrices := {f"{name}x": getattr(qp, name).data for name in sorted(changed & {"P", "A"})}:
            with _printed_errors():
                self._native.update(**matrices)
        self._counted_s += self._clock() - begun
        return True

    def _warm_start(self, x: NDArray[np.float64], y: NDArray[np.float64] | None) -> bool:
        self._native.warm_start(x=x, y=y)
        return True

    def _solve(self, left_s: float | None) -> RawSolution:
        limit_s = NO_LIMIT_S if left_s is None else left_s + self._counted_s
        if limit_s != self._native_limit_s:
            self._native.update_settings(time_limit=limit_s)
            self._native_limit_s = limit_s
        result = self._native.solve(raise_error=False)
        self._counted_s = 0.0
        name = NAMES.get(int(result.info.status_val), "")
        status = STATUS.get(name, Status.UNKNOWN)
        x, y = np.array(result.x), np.array(result.y)
        if status in WITHOUT_X:
            x, y = np.full_like(x, np.nan), np.full_like(y, np.nan)
        return RawSolution(x, y, status, int(result.info.iter), name or str(result.info.status))


@contextlib.contextmanager
def _printed_errors() -> Iterator[None]:
    """Raise what OSQP prints to sys.stdout, the only indication of a rejected matrix update."""
    error: Exception | None = None
    with contextlib.redirect_stdout(io.StringIO()) as printed:
        try:
            yield
        except osqp.OSQPException as raised:
            error = raised
    if error is not None or printed.getvalue():
        raise OSQPRefusalError(printed.getvalue().strip() or repr(error)) from error
