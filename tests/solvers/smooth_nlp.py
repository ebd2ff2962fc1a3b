"""A smooth nonlinear programme from callables, and its l1-elastic trust-region QP.

    minimise J(x) subject to h(x) = 0, g(x) <= 0, lower <= x <= upper              (A.1)

The subproblem is that of Appendix A (whose second constraint should read grad g'p + g <= 0), made elastic
so that an infeasible linearisation never ends the iteration: the Sl1QP of Fletcher; Nocedal & Wright,
Numerical Optimization, 2nd ed., eq. 18.50. Variables (p, s+, s-, t):

    minimise    1/2 p'W p + grad J'p + weight * sum(s+ + s- + t)
    subject to  h + grad h'p = s+ - s-,   g + grad g'p <= t,   s+, s-, t >= 0,
                lower <= x + p <= upper,  |p| <= radius
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, final

import numpy as np
import scipy.sparse as sp
from quasi_newton import damped_bfgs, nearest_positive

from solvers.checks import column_of_each_entry
from solvers.nlp import ConvexModel, Measure
from solvers.qp import QP

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

SUFFICIENT = 1e-4  # share of the predicted decrease that `solvers.sqp` asks for


@dataclass(frozen=True)
class Functions:
    """The callables of a smooth programme in n variables, with mu equalities and sigma inequalities.

    Attributes
    ----------
    objective: (n,) -> float. gradient: (n,) -> (n,).
    equalities: (n,) -> (mu,), h(x) = 0. equality_jacobian: (n,) -> (mu, n).
    inequalities: (n,) -> (sigma,), g(x) <= 0. inequality_jacobian: (n,) -> (sigma, n).
    hessian: (x, lambda (mu,), eta (sigma,)) -> (n, n), that of the Lagrangian; None for damped BFGS.
    """

    objective: Callable[[NDArray[np.float64]], float]
    gradient: Callable[[NDArray[np.float64]], NDArray[np.float64]]
    equalities: Callable[[NDArray[np.float64]], NDArray[np.float64]] | None = None
    equality_jacobian: Callable[[NDArray[np.float64]], NDArray[np.float64]] | None = None
    inequalities: Callable[[NDArray[np.float64]], NDArray[np.float64]] | None = None
    inequality_jacobian: Callable[[NDArray[np.float64]], NDArray[np.float64]] | None = None
    hessian: (
        Callable[
            [NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]],
            NDArray[np.float64],
        ]
        | None
    ) = None

    def __post_init__(self) -> None:
        """Raise `ValueError` for constraints without their Jacobian, or the other way round."""
        if (self.equalities is None) != (self.equality_jacobian is None):
            raise ValueError("equalities and equality_jacobian belong together")
        if (self.inequalities is None) != (self.inequality_jacobian is None):
            raise ValueError("inequalities and inequality_jacobian belong together")


@dataclass(frozen=True)
class _Linearisation:
    """Values and derivatives at one point."""

    gradient: NDArray[np.float64]
    h: NDArray[np.float64]
    Jh: NDArray[np.float64]
    g: NDArray[np.float64]
    Jg: NDArray[np.float64]

    def lagrangian_gradient(self, eq: NDArray[np.float64], ineq: NDArray[np.float64]) -> NDArray[np.float64]:
        return self.gradient + self.Jh.T @ eq + self.Jg.T @ ineq


@dataclass(frozen=True)
class _Pattern:
    """The fixed pattern of the subproblem: a full W, full Jacobians, unit columns for slacks and bounds."""

    A: sp.csc_array[np.float64]
    P: sp.csc_array[np.float64]
    jacobian: NDArray[np.intp]  # places of the Jacobians' entries, column by column, in A's data

    @classmethod
    def of(cls, n: int, mu: int, sigma: int) -> _Pattern:
        rows, slacks = mu + sigma, 2 * mu + sigma
        elastic = np.block(
            [
                [-np.eye(mu), np.eye(mu), np.zeros((mu, sigma))],
                [np.zeros((sigma, 2 * mu)), -np.eye(sigma)],
            ]
        )
        dense = np.block([[np.ones((rows, n)), elastic], [np.eye(n + slacks)]])
        A = sp.csc_array(dense)
        P = sp.csc_array(np.pad(np.triu(np.ones((n, n))), (0, slacks)))
        return cls(A, P, np.flatnonzero((A.indices < rows) & (column_of_each_entry(A) < n)))

    def matrices(
        self, W: NDArray[np.float64], jacobian: NDArray[np.float64]
    ) -> tuple[sp.csc_array[np.float64], sp.csc_array[np.float64]]:
        """Return P and A with the values of W: (n, n) and of the Jacobian: (mu + sigma, n)."""
        data = self.A.data.copy()
        data[self.jacobian] = jacobian.T.ravel()
        # row r of the lower triangle of the transpose is column r of the upper triangle
        triangle = W.T[np.tril_indices(W.shape[0])]
        P = sp.csc_array((triangle, self.P.indices, self.P.indptr), shape=self.P.shape)
        return P, sp.csc_array((data, self.A.indices, self.A.indptr), shape=self.A.shape)


@final
class SmoothNLP:
    """A small dense smooth programme, convexified for `solvers.sqp`.

    Steps that do not decrease the merit are corrected to second order, against the Maratos effect.

    Parameters
    ----------
    functions: the callables.
    n: number of variables.
    lower, upper: (n,), bounds on x, None for none; every subproblem keeps to them.
    weight: of the constraints' l1 penalty; must exceed the largest multiplier.
    """

    def __init__(
        self,
        functions: Functions,
        n: int,
        lower: NDArray[np.float64] | None = None,
        upper: NDArray[np.float64] | None = None,
        weight: float = 10.0,
    ) -> None:
        self._functions = functions
        self._n = n
        self._lower = np.full(n, -np.inf) if lower is None else lower
        self._upper = np.full(n, np.inf) if upper is None else upper
        if self._lower.shape != (n,) or self._upper.shape != (n,) or not (self._lower <= self._upper).all():
            raise ValueError(f"lower <= upper must be ({n},), got {self._lower} and {self._upper}")
        if not 0.0 < weight < np.inf:
            raise ValueError(f"weight must be positive and finite, got {weight}")
        self._weight = weight
        self._hessian: NDArray[np.float64] | None = None
        self._multipliers: tuple[NDArray[np.float64], NDArray[np.float64]] | None = None
        self._pattern: _Pattern | None = None

    def measure(self, x: NDArray[np.float64]) -> Measure:
        """Return objective, worst violation and sum of violations at `x`: (n,)."""
        h, g = self._constraints(x)
        outside = np.maximum(self._lower - x, x - self._upper)
        excess = np.concatenate((np.abs(h), np.maximum(g, 0.0), np.maximum(outside, 0.0)))
        return Measure(float(self._functions.objective(x)), float(excess.max()), float(excess.sum()))

    def convexify(self, x: NDArray[np.float64], radius: float) -> ConvexModel:
        """Return the elastic subproblem around `x`: (n,), with |p| <= radius."""
        at = self._linearise(x)
        W = self._model_hessian(x, at)
        qp = self._subproblem(x, at, W, radius)
        n, weight = self._n, self._weight
        bounds = (self._lower, self._upper)
        outside = _penalty_outside(x, *bounds)
        elastic = float(np.abs(at.h).sum() + np.maximum(at.g, 0.0).sum()) + outside

        def predicted(qp_x: NDArray[np.float64]) -> float:
            p = qp_x[:n]
            # from p, not from the slacks: an inexact solver leaves these a little off
            left = np.abs(at.h + at.Jh @ p).sum() + np.maximum(at.g + at.Jg @ p, 0.0).sum()
            decrease = -(at.gradient @ p + 0.5 * p @ W @ p)
            return float(decrease + weight * (elastic - left - _penalty_outside(x + p, *bounds)))

        def recover(qp_x: NDArray[np.float64]) -> NDArray[np.float64]:
            full = x + qp_x[:n]
            enough = self.measure(x).merit(weight) - SUFFICIENT * predicted(qp_x)
            if self.measure(full).merit(weight) <= enough:
                return full
            corrected = self.corrected(x, full)
            return corrected if self.measure(corrected).merit(weight) <= enough else full

        return ConvexModel(qp, recover, predicted, weight)

    def accepted(
        self, x_old: NDArray[np.float64], x_new: NDArray[np.float64], multipliers: NDArray[np.float64]
    ) -> None:
        """Keep the multipliers; without an exact Hessian make a damped BFGS update with them."""
        old, new = self._linearise(x_old), self._linearise(x_new)
        eq = multipliers[: old.h.size]
        ineq = np.maximum(multipliers[old.h.size : old.h.size + old.g.size], 0.0)
        self._multipliers = (eq, ineq)
        if self._functions.hessian is None:
            change = new.lagrangian_gradient(eq, ineq) - old.lagrangian_gradient(eq, ineq)
            self._hessian = damped_bfgs(self._hessian, x_new - x_old, change)

    def corrected(self, x: NDArray[np.float64], x_new: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the second-order correction of a step (Nocedal & Wright, eq. 18.36).

        The constraints that the step leaves violated are driven to zero at `x_new` with the Jacobian of
        `x`, by the shortest further step.
        """
        at = self._linearise(x)
        h, g = self._constraints(x_new)
        violated = g > 0.0
        residual = np.concatenate((h, g[violated]))
        if not residual.size or not np.isfinite(residual).all():
            return x_new
        further = np.linalg.lstsq(np.vstack((at.Jh, at.Jg[violated])), -residual, rcond=None)[0]
        result: NDArray[np.float64] = np.clip(x_new + further, self._lower, self._upper)
        return result

    def _constraints(self, x: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        f = self._functions
        h = np.zeros(0) if f.equalities is None else np.asarray(f.equalities(x), np.float64)
        g = np.zeros(0) if f.inequalities is None else np.asarray(f.inequalities(x), np.float64)
        return h, g

    def _linearise(self, x: NDArray[np.float64]) -> _Linearisation:
        f, (h, g) = self._functions, self._constraints(x)
        none = np.zeros((0, self._n))
        Jh = none if f.equality_jacobian is None else np.asarray(f.equality_jacobian(x), np.float64)
        Jg = none if f.inequality_jacobian is None else np.asarray(f.inequality_jacobian(x), np.float64)
        return _Linearisation(np.asarray(f.gradient(x), np.float64), h, Jh, g, Jg)

    def _model_hessian(self, x: NDArray[np.float64], at: _Linearisation) -> NDArray[np.float64]:
        if self._functions.hessian is None:
            return np.eye(self._n) if self._hessian is None else self._hessian
        eq, ineq = self._multipliers or (np.zeros(at.h.size), np.zeros(at.g.size))
        return nearest_positive(self._functions.hessian(x, eq, ineq))

    def _subproblem(self, x: NDArray[np.float64], at: _Linearisation, W: NDArray[np.float64], radius: float) -> QP:
        n, mu, sigma = self._n, at.h.size, at.g.size
        slacks = 2 * mu + sigma
        if self._pattern is None:
            self._pattern = _Pattern.of(n, mu, sigma)
        P, A = self._pattern.matrices(W, np.vstack((at.Jh, at.Jg)))
        q = np.concatenate((at.gradient, np.full(slacks, self._weight)))
        # where x is out of bounds this makes p lead back to them, as far as the radius allows
        down, up = np.clip(self._lower - x, -radius, radius), np.clip(self._upper - x, -radius, radius)
        lower = np.concatenate((-at.h, np.full(sigma, -np.inf), down, np.zeros(slacks)))
        upper = np.concatenate((-at.h, -at.g, up, np.full(slacks, np.inf)))
        return QP(P, q, A, lower, upper)


def _penalty_outside(x: NDArray[np.float64], lower: NDArray[np.float64], upper: NDArray[np.float64]) -> float:
    """Return the sum of the violations of the bounds."""
    return float(np.maximum(np.maximum(lower - x, x - upper), 0.0).sum())
