"""Residuals of the KKT conditions; they, rather than a library's status, decide whether a QP is solved."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from solvers.qp import INFINITE

if TYPE_CHECKING:
    import scipy.sparse as sp
    from numpy.typing import NDArray

    from solvers.qp import QP, SecondOrderCones


@dataclass(frozen=True)
class Tolerances:
    """Residual r of scale s is accepted if r <= absolute + relative * s (the rule of OSQP, eq. 26-27)."""

    absolute: float
    relative: float = 0.0

    def __post_init__(self) -> None:
        """Raise `ValueError` for a tolerance that is negative or not finite."""
        for value in (self.absolute, self.relative):
            if not (math.isfinite(value) and value >= 0.0):
                raise ValueError(f"a tolerance must be finite and not negative, got {value}")


@dataclass(frozen=True)
class Residuals:
    """Residuals in the infinity norm, and the scales to which they are relative.

    Attributes
    ----------
    primal: largest violation of l <= A x <= u and of the cones.
    dual: largest component of P x + q + A'y - G'z, or of a multiplier of the wrong sign (at an infinite
        bound, or outside the dual cone).
    gap: |primal objective - dual objective|.
    primal_scale, dual_scale, gap_scale: largest term of each sum above.
    """

    primal: float
    dual: float
    gap: float
    primal_scale: float = 0.0
    dual_scale: float = 0.0
    gap_scale: float = 0.0

    def within(self, tolerances: Tolerances) -> bool:
        """Return whether all three residuals are within tolerance; NaN never is."""
        pairs = (
            (self.primal, self.primal_scale),
            (self.dual, self.dual_scale),
            (self.gap, self.gap_scale),
        )
        return all(
            math.isfinite(scale) and residual <= tolerances.absolute + tolerances.relative * scale
            for residual, scale in pairs
        )


def kkt_residuals(
    qp: QP, x: NDArray[np.float64], y: NDArray[np.float64], cone_dual: NDArray[np.float64] | None = None
) -> Residuals:
    """Return the residuals of a primal-dual pair, with infinite bounds handled exactly.

    Parameters
    ----------
    qp: the data at the time of the solve.
    x: (n,). y: (m,), positive at the upper bound. cone_dual: (k,), within K; None counts as zero.

    Returns
    -------
    Residuals; infinite where x or a multiplier is not finite.
    """
    cones = qp.cones
    z = np.zeros(cones.h.shape[0]) if cones is not None and cone_dual is None else cone_dual
    if not (np.isfinite(x).all() and np.isfinite(y).all() and (z is None or np.isfinite(z).all())):
        return Residuals(math.inf, math.inf, math.inf)
    # a diverged but finite x may overflow: the result is then inf or NaN, which `within` rejects
    with np.errstate(over="ignore", invalid="ignore"):
        return _finite_residuals(qp, x, y, cones, z)


def _finite_residuals(
    qp: QP,
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    cones: SecondOrderCones | None,
    z: NDArray[np.float64] | None,
) -> Residuals:
    Ax, Aty = _times(qp.A, x), _times(qp.A.T, y)
    Px = _times(qp.P, x) + _times(qp.P.T, x) - qp.P.diagonal() * x
    support, wrong_sign = _support(qp, y)
    xPx, qx = float(x @ Px), float(qp.q @ x)
    primal = max(_largest(Ax - qp.u), _largest(qp.l - Ax))
    stationarity = Px + qp.q + Aty
    primal_scale = _norm(Ax)
    dual_scale = max(_norm(Px), _norm(Aty), _norm(qp.q))
    if cones is not None and z is not None:
        slack, Gtz = cones.h + _times(cones.G, x), _times(cones.G.T, z)
        primal = max(primal, _outside(slack, cones.sizes))
        wrong_sign = max(wrong_sign, _outside(z, cones.sizes))
        stationarity -= Gtz
        primal_scale = max(primal_scale, _norm(slack), _norm(cones.h))
        dual_scale = max(dual_scale, _norm(Gtz))
        support += float(cones.h @ z)
    return Residuals(
        primal,
        max(_norm(stationarity), wrong_sign),
        abs(xPx + qx + support),
        primal_scale,
        dual_scale,
        max(abs(xPx), abs(qx), abs(support)),
    )


def _support(qp: QP, y: NDArray[np.float64]) -> tuple[float, float]:
    """Return sup {y'v: l <= v <= u} over the finite bounds, and the largest |y| at an infinite one."""
    active = np.where(y > 0.0, qp.u, qp.l)
    finite = np.abs(active) < INFINITE
    return float(y[finite] @ active[finite]), _norm(y[~finite])


def _outside(values: NDArray[np.float64], sizes: tuple[int, ...]) -> float:
    """Return the largest ||v|| - t over the cones (t, v), at least 0."""
    if not sizes:
        return 0.0
    starts = np.cumsum((0, *sizes[:-1]))
    tails = values.copy()
    tails[starts] = 0.0
    return _largest(np.sqrt(np.add.reduceat(tails * tails, starts)) - values[starts])


def _times(
    matrix: sp.csc_array[np.float64] | sp.csr_array[np.float64], vector: NDArray[np.float64]
) -> NDArray[np.float64]:
    product: NDArray[np.float64] = matrix @ vector  # type: ignore[assignment] # the stubs are too wide
    return product


def _norm(values: NDArray[np.float64]) -> float:
    return float(np.abs(values).max(initial=0.0))


def _largest(values: NDArray[np.float64]) -> float:
    return float(values.max(initial=0.0))
