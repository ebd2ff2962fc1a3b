"""PIQP: a proximal interior-point method; fast and accurate on MPC problems, cannot be warm-started.

l <= A x <= u is split into equalities A_e x = b and the rest h_l <= G x <= h_u; the split is fixed at set-up.

Workarounds (piqp 0.7.0): a row without bounds is zeroed in G permanently (and a notice printed), so that it
stays free after an update gives it a bound: free rows are left out, and a change of kind causes a new set-up. There
is no time limit: the number of iterations is bounded by the time left over the measured time of one. Set-ups of QPs
with 180,000 variables and more were seen to corrupt memory, or not to end (in the ordering of the factors), so that
`Capabilities.variables_max` keeps to what was seen to work: 93,280 variables are set up in 2 s.
"""

from __future__ import annotations

from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
import piqp

from solvers.backends.base import Backend, Options, RawSolution
from solvers.backends.capabilities import Capabilities
from solvers.backends.rows import EQUAL, Block, StackedRows, native_csc, row_kinds, stack_rows
from solvers.status import Status

if TYPE_CHECKING:
    from collections.abc import Mapping

    import scipy.sparse as sp
    from numpy.typing import NDArray

    from solvers.qp import QP

MAX_ITERATIONS = 250
"""PIQP's own default."""

CAPABILITIES = Capabilities(second_order_cones=False, inexact=1e-3, fine=1e-4, accurate=1e-9, entry_iteration_s=6.8e-8)
"""Measured as in `capabilities`. Mean J of the refined plans, by tolerance: 1e-2 5.31 m, 1e-3 5.16 m, 1e-4 4.97 m,
1e-6 4.98 m; in 0.22, 0.37, 0.84, 0.94 s, where 1e-3 is for early stages only. All of 72 accurate QPs are solved to
1e-10 yet, and 1e-9 takes no longer than 1e-6. An iteration takes 4.8e-8 to 1.0e-7 s an entry."""

STATUS: Mapping[str, Status] = MappingProxyType(
    {
        "PIQP_SOLVED": Status.SOLVED,
        "PIQP_MAX_ITER_REACHED": Status.MAX_ITERATIONS,
        "PIQP_PRIMAL_INFEASIBLE": Status.PRIMAL_INFEASIBLE,
        "PIQP_DUAL_INFEASIBLE": Status.DUAL_INFEASIBLE,
        "PIQP_NUMERICS": Status.NUMERICAL_ERROR,
        "PIQP_UNSOLVED": Status.UNKNOWN,
        "PIQP_INVALID_SETTINGS": Status.INVALID_DATA,
    }
)


@dataclass(frozen=True)
class _Layout:
    """The positions of the problem's rows in the native layout."""

    kinds: NDArray[np.uint8]
    equal: NDArray[np.intp]
    other: NDArray[np.intp]
    P: sp.csc_matrix[np.float64]
    A: StackedRows
    G: StackedRows

    def multipliers(self, result: Any, m: int) -> NDArray[np.float64]:
        """Join the native multipliers into y, positive at the upper bound."""
        y = np.zeros(m)
        y[self.equal] = result.y
        y[self.other] = np.asarray(result.z_u) - np.asarray(result.z_l)
        return y


class PIQPBackend(Backend):
    """PIQP's sparse solver. `warm_start` has no effect: an interior-point method has none."""

    name: ClassVar[str] = "piqp"
    capabilities: ClassVar[Capabilities] = CAPABILITIES

    _native: Any = None
    _layout: _Layout
    _iteration_s: float | None = None  # measured time of one iteration since the last set-up

    def _setup(self, qp: QP, options: Options) -> None:
        layout = _layout(qp)
        native = piqp.SparseSolver()
        settings = native.settings
        settings.verbose = options.verbose
        settings.num_threads = 1
        settings.eps_abs = settings.eps_rel = options.tolerance
        settings.eps_duality_gap_abs = settings.eps_duality_gap_rel = options.tolerance
        native.setup(
            layout.P,
            qp.q,
            layout.A.matrix,
            qp.u[layout.equal],
            layout.G.matrix,
            qp.l[layout.other],
            qp.u[layout.other],
        )
        self._native, self._layout, self._iteration_s = native, layout, None

    def _update(self, qp: QP, changed: frozenset[str]) -> bool:
        layout = self._layout
        values: dict[str, Any] = {}
        if not changed.isdisjoint({"l", "u"}):
            if not np.array_equal(row_kinds(qp.l, qp.u), layout.kinds):
                return False
            values |= {"b": qp.u[layout.equal], "h_l": qp.l[layout.other], "h_u": qp.u[layout.other]}
        if "q" in changed:
            values["c"] = qp.q
        if "P" in changed:
            values["P"] = layout.P  # shares its data with the problem
        if "A" in changed:
            layout.A.refresh(qp.A.data)
            layout.G.refresh(qp.A.data)
            values |= {"A": layout.A.matrix, "G": layout.G.matrix}
        self._native.update(**values)
        return True

    def _warm_start(self, x: NDArray[np.float64], y: NDArray[np.float64] | None) -> bool:
        del x, y
        return False

    def _solve(self, left_s: float | None) -> RawSolution:
        most = self._options.max_iterations or MAX_ITERATIONS
        if left_s is None:
            return self._run(most, Status.MAX_ITERATIONS)
        begun = self._clock()
        if self._iteration_s is None:
            # the time of an iteration is not known yet: one is run to measure it (and repeated below)
            self._run(1, Status.TIME_LIMIT)
        left_s -= self._clock() - begun
        each_s = self._iteration_s or 0.0
        affordable = most if each_s <= 0.0 else int(min(left_s / each_s, most))
        if left_s <= 0.0 or affordable < 1:
            return self._result(Status.TIME_LIMIT, "no time for an iteration")
        return self._run(affordable, Status.MAX_ITERATIONS if affordable == most else Status.TIME_LIMIT)

    def _run(self, iterations: int, at_the_limit: Status) -> RawSolution:
        """Solve within a number of iterations; reaching it yields the status `at_the_limit`."""
        self._native.settings.max_iter = iterations
        begun = self._clock()
        name = self._native.solve().name
        # in addition to its iterations a solve factorises once for its starting point
        self._iteration_s = (self._clock() - begun) / (int(self._native.result.info.iter) + 1)
        status = STATUS.get(name, Status.UNKNOWN)
        return self._result(at_the_limit if status is Status.MAX_ITERATIONS else status, name)

    def _result(self, status: Status, detail: str) -> RawSolution:
        result = self._native.result
        y = self._layout.multipliers(result, self.qp.m)
        return RawSolution(np.array(result.x), y, status, int(result.info.iter), detail)


def _layout(qp: QP) -> _Layout:
    kinds = row_kinds(qp.l, qp.u)
    equal = np.flatnonzero(kinds == EQUAL)
    other = np.flatnonzero((kinds != EQUAL) & (kinds != 0))
    A = stack_rows([Block(qp.A, equal, 1.0)], qp.A.data)
    G = stack_rows([Block(qp.A, other, 1.0)], qp.A.data)
    return _Layout(kinds, equal, other, native_csc(qp.P), A, G)
