"""The base class of QP back-ends: validation and error handling around a native solver, acceptance of its results.

Known failure modes of native solvers are handled here, once.
"""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from dataclasses import replace
from typing import TYPE_CHECKING, ClassVar, TypeVar

import numpy as np

from solvers.backends.acceptance import OVERRULABLE, RawSolution, accepted_status
from solvers.backends.options import Options
from solvers.checks import InvalidQPError, check_bounds, check_diagonal, check_finite, column_of_each_entry
from solvers.residuals import kkt_residuals
from solvers.solution import QPSolution
from solvers.status import Status

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from solvers.backends.capabilities import Capabilities
    from solvers.qp import QP

T = TypeVar("T")

__all__ = ["Backend", "BackendStateError", "Options", "RawSolution"]


class BackendStateError(RuntimeError):
    """`update`, `warm_start` or `solve` was called before `setup`."""


class Backend(ABC):
    """One native QP solver that holds one problem, whose values, but not its sparsity pattern, may change.

    Usage: `setup` once, then any number of `update`, `warm_start` and `solve`. Each class declares its `name` in the
    registry and its `capabilities`, and implements `_setup`, `_update`, `_warm_start` and `_solve`.

    Parameters
    ----------
    clock: monotonic time [s].
    """

    name: ClassVar[str]
    capabilities: ClassVar[Capabilities]

    def __init__(self, clock: Callable[[], float] = time.perf_counter) -> None:
        self._clock = clock
        self._options = Options()
        self._qp: QP | None = None
        self._diagonal: NDArray[np.intp] = np.zeros(0, np.intp)
        self._start: tuple[NDArray[np.float64], NDArray[np.float64] | None] | None = None
        self._ready = False  # whether the native solver holds the current data
        self._pending_since: float | None = None
        self._setup_time_s = 0.0
        self._failure = ""

    @property
    def qp(self) -> QP:
        """The current data; change them only through `update`."""
        if self._qp is None:
            raise BackendStateError(f"{self.name}: call setup() first")
        return self._qp

    def setup(self, qp: QP, options: Options | None = None) -> None:
        """Take a new problem; its values are copied, its pattern is shared.

        A native failure is not raised here: the next `solve` reports it.

        Raises
        ------
        InvalidQPError: for invalid data, or cones that this back-end lacks; nothing has changed then.
        """
        begun = self._clock()
        qp.validate()
        if qp.cones is not None and not self.capabilities.second_order_cones:
            raise InvalidQPError(f"cones: {self.name} has no second-order cones")
        self._options = options or Options()
        self._qp = qp.own_copy()
        self._diagonal = np.flatnonzero(qp.P.indices == column_of_each_entry(qp.P))
        self._start = None
        self._setup_time_s = 0.0
        self._pending_since = begun
        self._build(begun)

    def load(self, qp: QP, options: Options | None = None) -> bool:
        """Take a problem, by `update` if its pattern, cones and options are the current ones, else by `setup`.

        Returns
        -------
        Whether a set-up was needed.
        """
        old = self._qp
        if old is None or (options or Options()) != self._options or not old.same_pattern(qp):
            self.setup(qp, options)
            return True
        self.update(P=qp.P.data, q=qp.q, A=qp.A.data, l=qp.l, u=qp.u)
        return False

    def update(
        self,
        *,
        P: NDArray[np.float64] | None = None,
        q: NDArray[np.float64] | None = None,
        A: NDArray[np.float64] | None = None,
        l: NDArray[np.float64] | None = None,  # noqa: E741 - the field's own letter
        u: NDArray[np.float64] | None = None,
    ) -> None:
        """Replace values in place.

        Parameters
        ----------
        P, A: the new data arrays of the stored entries (P: of the upper triangle), in the same pattern.
        q: (n,). l, u: (m,). None leaves a field as it is.

        Raises
        ------
        InvalidQPError: before anything, here or in the native solver, has changed.
        """
        qp = self.qp
        given = {"P": P, "q": q, "A": A, "l": l, "u": u}
        current = {"P": qp.P.data, "q": qp.q, "A": qp.A.data, "l": qp.l, "u": qp.u}
        new = {name: values for name, values in given.items() if values is not None}
        for name in new.keys() & {"P", "q", "A"}:
            check_finite(name, new[name], current[name].size)
        if P is not None:
            check_diagonal(P, self._diagonal)
        if l is not None or u is not None:
            check_bounds(qp.l if l is None else l, qp.u if u is None else u, qp.m)
        for name, values in new.items():
            np.copyto(current[name], values)
        qp.normalise_bounds()
        if self._ready and new:
            # False: the change does not fit the native pattern; the next solve sets up again
            self._ready = self._attempt(lambda: self._update(qp, frozenset(new))) is True

    def warm_start(self, x: NDArray[np.float64], y: NDArray[np.float64] | None = None) -> None:
        """Start the next solve from x: (n,) and y: (m,); without effect on interior-point methods.

        Raises
        ------
        InvalidQPError: for wrong shapes or non-finite values, which OSQP would carry into later solves.
        """
        check_finite("x", x, self.qp.n)
        if y is not None:
            check_finite("y", y, self.qp.m)
        self._start = (x.copy(), None if y is None else y.copy())
        if self._ready:
            self._ready = self._attempt(lambda: self._warm_start(x, y)) is not None

    def solve(self, time_limit_s: float | None = None) -> QPSolution:
        """Solve the current problem; never raises once `setup` has been called.

        Parameters
        ----------
        time_limit_s: wall time [s], None for no limit. The first solve after `setup` counts it from the
            beginning of that `setup`; if no time is left, the warm start is returned with `TIME_LIMIT`.
        """
        qp = self.qp
        begun = self._clock()
        origin = begun if self._pending_since is None else self._pending_since
        if not self._ready:
            self._build(begun)
        self._pending_since = None
        setup_time_s, self._setup_time_s = self._setup_time_s, 0.0
        if not self._ready:
            return self._unsolved(Status.NUMERICAL_ERROR, setup_time_s, self._failure)
        solving = self._clock()
        left_s = None if time_limit_s is None else time_limit_s - (solving - origin)
        if left_s is not None and not left_s > 0.0:
            return self._unsolved(Status.TIME_LIMIT, setup_time_s, "no time left after set-up")
        raw = self._attempt(lambda: self._solve(left_s))
        solve_time_s = self._clock() - solving
        if raw is None:
            self._forget()
            return replace(
                self._unsolved(Status.NUMERICAL_ERROR, setup_time_s, self._failure), solve_time_s=solve_time_s
            )
        return self._accepted(qp, raw, setup_time_s, solve_time_s)

    @abstractmethod
    def _setup(self, qp: QP, options: Options) -> None:
        """Build the native solver; may raise anything."""

    @abstractmethod
    def _update(self, qp: QP, changed: frozenset[str]) -> bool:
        """Pass the changed fields to the native solver; False requests a new set-up instead."""

    @abstractmethod
    def _warm_start(self, x: NDArray[np.float64], y: NDArray[np.float64] | None) -> bool:
        """Pass a starting point to the native solver; return whether it had an effect."""

    @abstractmethod
    def _solve(self, left_s: float | None) -> RawSolution:
        """Solve within `left_s` > 0 seconds."""

    def _build(self, begun: float) -> None:
        """Set up the native solver with the current data; `_ready` is whether that succeeded."""
        qp, start = self.qp, self._start
        if not self.capabilities.bears(qp):  # native code may crash the process
            self._failure = f"{self.name} is given at most {self.capabilities.variables_max} variables, not {qp.n}"
            return
        self._ready = self._attempt(lambda: (self._setup(qp, self._options), True)) is not None
        if self._ready and start is not None:
            self._ready = self._attempt(lambda: self._warm_start(*start)) is not None
        self._setup_time_s += self._clock() - begun

    def _attempt(self, call: Callable[[], T]) -> T | None:
        """Return the result of a native call, or None, with the reason in `_failure`, if it raised."""
        try:
            return call()
        except (KeyboardInterrupt, SystemExit):
            raise
        except BaseException as error:  # noqa: BLE001 - a Rust panic is not an Exception
            self._failure = repr(error)
            return None

    def _accepted(self, qp: QP, raw: RawSolution, setup_time_s: float, solve_time_s: float) -> QPSolution:
        """Return the solution with the status that its residuals on the current data warrant."""
        residuals = kkt_residuals(qp, raw.x, raw.y, raw.cone_dual)
        status = accepted_status(raw, residuals, self._options.acceptance)
        if status in {Status.NUMERICAL_ERROR, Status.NON_CONVEX}:
            self._forget()
        elif status in OVERRULABLE:
            self._start = (raw.x, raw.y)
        times = (setup_time_s, solve_time_s)
        work = self.capabilities.entry_iteration_s * raw.iterations
        return QPSolution(
            raw.x, raw.y, status, residuals, raw.iterations, *times, raw.cone_dual, raw.detail, self.name, work
        )

    def _forget(self) -> None:
        """Discard the warm start and the native solver, whose state may be corrupt after a failure."""
        self._start = None
        self._ready = False

    def _unsolved(self, status: Status, setup_time_s: float, detail: str) -> QPSolution:
        """Return the warm start, or zeros, as the solution of a solve that did not take place."""
        x, y = self._start or (np.zeros(self.qp.n), None)
        y = np.zeros(self.qp.m) if y is None else y
        return QPSolution(x, y, status, kkt_residuals(self.qp, x, y), 0, setup_time_s, 0.0, None, detail, self.name)
