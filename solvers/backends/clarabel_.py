"""Clarabel: an interior-point method; accurate, supports second-order cones, cannot be warm-started.

l <= A x <= u becomes A_c x + s = b with s in a product of cones: zero for the equalities, nonnegative for
each finite side, then the second-order cones of the problem as they are. The split is fixed at set-up.

Workarounds (clarabel 0.11.1): updates in place need presolve, chordal decomposition and the dropping of
zeros switched off; its own time limit counts the set-up again at every solve, so a callback between its
iterations checks the deadline instead; x is finite after a NumericalError; unknown keywords of `update`
are printed and ignored.
"""

from __future__ import annotations

from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, ClassVar, final

import clarabel
import numpy as np

from solvers.backends.base import Backend, Options, RawSolution
from solvers.backends.capabilities import Capabilities
from solvers.backends.rows import EQUAL, LOWER, UPPER, Block, StackedRows, native_csc, row_kinds, stack_rows
from solvers.status import Status

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from solvers.qp import QP

MAX_ITERATIONS = 200
"""Clarabel's own default."""

CAPABILITIES = Capabilities(
    second_order_cones=True,
    inexact=1e-3,
    fine=1e-4,
    accurate=1e-9,
    entry_iteration_s=1.6e-7,
    variables_max=180_000,
)
"""Measured as in `capabilities`. Mean J of the refined plans, by tolerance: 1e-2 5.27 m, 1e-3 5.12 m, 1e-4 4.98 m,
1e-6 4.99 m; in 0.38, 0.86, 1.27, 1.57 s, where 1e-3 is for early stages only. All of 72 accurate QPs are solved to
1e-10 yet, and 1e-9 takes no longer than 1e-6. An iteration takes 1.3e-7 to 2.0e-7 s an entry.
QPs of up to 182,043 variables were set up in 11 s."""

STATUS: Mapping[str, Status] = MappingProxyType(
    {
        "Solved": Status.SOLVED,
        "AlmostSolved": Status.INACCURATE,
        "PrimalInfeasible": Status.PRIMAL_INFEASIBLE,
        "AlmostPrimalInfeasible": Status.PRIMAL_INFEASIBLE,
        "DualInfeasible": Status.DUAL_INFEASIBLE,
        "AlmostDualInfeasible": Status.DUAL_INFEASIBLE,
        "MaxIterations": Status.MAX_ITERATIONS,
        "MaxTime": Status.TIME_LIMIT,
        "CallbackTerminated": Status.TIME_LIMIT,
        "NumericalError": Status.NUMERICAL_ERROR,
        "InsufficientProgress": Status.NUMERICAL_ERROR,
        "Unsolved": Status.UNKNOWN,
    }
)


@dataclass(frozen=True)
class _Layout:
    """The positions of the problem's rows in the native layout."""

    kinds: NDArray[np.uint8]
    equal: NDArray[np.intp]
    upper: NDArray[np.intp]
    lower: NDArray[np.intp]
    stack: StackedRows
    cone_data: NDArray[np.float64]  # of G, after that of A
    cone_h: NDArray[np.float64]

    def right_hand_side(self, qp: QP) -> NDArray[np.float64]:
        return np.concatenate((qp.u[self.equal], qp.u[self.upper], -qp.l[self.lower], self.cone_h))

    def refresh(self, qp: QP) -> NDArray[np.float64]:
        """Return the native data of the matrix for the current A."""
        data = np.concatenate((qp.A.data, self.cone_data)) if self.cone_data.size else qp.A.data
        self.stack.refresh(data)
        values: NDArray[np.float64] = self.stack.matrix.data
        return values

    def multipliers(self, z: NDArray[np.float64], m: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Split the native multipliers into y, positive at the upper bound, and those of the cones."""
        ends = np.cumsum((self.equal.size, self.upper.size, self.lower.size))
        equal, upper, lower, cone = np.split(z, ends)
        y = np.zeros(m)
        y[self.equal] = equal
        y[self.upper] = upper
        y[self.lower] -= lower
        return y, cone


@final
class ClarabelBackend(Backend):
    """Clarabel, single-threaded, with QDLDL. `warm_start` has no effect: an interior-point method has none."""

    name: ClassVar[str] = "clarabel"
    capabilities: ClassVar[Capabilities] = CAPABILITIES

    _native: Any = None
    _layout: _Layout

    def _setup(self, qp: QP, options: Options) -> None:
        layout = _layout(qp)
        cones = [
            clarabel.ZeroConeT(layout.equal.size),
            clarabel.NonnegativeConeT(layout.upper.size + layout.lower.size),
        ]
        cones += [clarabel.SecondOrderConeT(size) for size in (qp.cones.sizes if qp.cones is not None else ())]
        self._native = clarabel.DefaultSolver(
            native_csc(qp.P), qp.q, layout.stack.matrix, layout.right_hand_side(qp), cones, _settings(options)
        )
        self._layout = layout

    def _update(self, qp: QP, changed: frozenset[str]) -> bool:
        layout = self._layout
        values: dict[str, NDArray[np.float64]] = {}
        if not changed.isdisjoint({"l", "u"}):
            if not np.array_equal(row_kinds(qp.l, qp.u), layout.kinds):
                return False
            values["b"] = layout.right_hand_side(qp)
        if "q" in changed:
            values["q"] = qp.q
        if "P" in changed:
            values["P"] = qp.P.data
        if "A" in changed:
            values["A"] = layout.refresh(qp)
        self._native.update(**values)
        return True

    def _warm_start(self, x: NDArray[np.float64], y: NDArray[np.float64] | None) -> bool:
        del x, y
        return False

    def _solve(self, left_s: float | None) -> RawSolution:
        if left_s is None:
            self._native.unset_termination_callback()
        else:
            clock, deadline = self._clock, self._clock() + left_s
            self._native.set_termination_callback(lambda _info: clock() >= deadline)
        result = self._native.solve()
        name = str(result.status)
        y, cone_dual = self._layout.multipliers(np.array(result.z), self.qp.m)
        return RawSolution(
            np.array(result.x),
            y,
            STATUS.get(name, Status.UNKNOWN),
            int(result.iterations),
            name,
            cone_dual if self.qp.cones is not None else None,
        )


def _layout(qp: QP) -> _Layout:
    kinds = row_kinds(qp.l, qp.u)
    equal = np.flatnonzero(kinds == EQUAL)
    upper = np.flatnonzero(kinds & UPPER)
    lower = np.flatnonzero(kinds & LOWER)
    blocks = [Block(qp.A, equal, 1.0), Block(qp.A, upper, 1.0), Block(qp.A, lower, -1.0)]
    cone_data = cone_h = np.zeros(0)
    if qp.cones is not None:
        cone_data, cone_h = qp.cones.G.data, qp.cones.h
        # s = h + G x, so A_c = -G
        blocks.append(Block(qp.cones.G, np.arange(cone_h.size), -1.0, offset=qp.A.nnz))
    stack = stack_rows(blocks, np.concatenate((qp.A.data, cone_data)))
    return _Layout(kinds, equal, upper, lower, stack, cone_data, cone_h)


def _settings(options: Options) -> Any:
    settings = clarabel.DefaultSettings.default()
    settings.verbose = options.verbose
    settings.max_iter = options.max_iterations or MAX_ITERATIONS
    settings.tol_feas = settings.tol_gap_abs = settings.tol_gap_rel = options.tolerance
    settings.max_threads = 1
    settings.direct_solve_method = "qdldl"
    # each of these would prevent updates in place, or silently change their meaning
    settings.presolve_enable = False
    settings.chordal_decomposition_enable = False
    settings.input_sparse_dropzeros = False
    return settings
