"""Positive definite stand-ins for the Hessian of the Lagrangian (W_k of Appendix A)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

DAMPING = 0.2  # Powell's constant; Nocedal & Wright, procedure 18.2
SMALLEST_EIGENVALUE = 1e-8
SHORTEST_STEP = 1e-14


def damped_bfgs(
    B: NDArray[np.float64] | None, step: NDArray[np.float64], change: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the damped BFGS update of B (Powell; Nocedal & Wright, procedure 18.2).

    Parameters
    ----------
    B: (n, n), positive definite, or None before the first step.
    step: (n,), x_new - x_old.
    change: (n,), of the gradient of the Lagrangian, at the same multipliers.

    Returns
    -------
    (n, n), positive definite whatever the curvature along the step.
    """
    curvature = float(step @ change)
    if B is None:
        # the scale of the problem, as far as one step shows it (eq. 6.20)
        scale = float(change @ change) / curvature if curvature > 0.0 else 1.0
        B = np.clip(scale, 1e-3, 1e3) * np.eye(step.size)
    Bs = B @ step
    sBs = float(step @ Bs)
    if sBs <= SHORTEST_STEP**2 or not np.isfinite(change).all():
        return B
    damp = 1.0 if curvature >= DAMPING * sBs else (1.0 - DAMPING) * sBs / (sBs - curvature)
    r = damp * change + (1.0 - damp) * Bs
    result: NDArray[np.float64] = B - np.outer(Bs, Bs) / sBs + np.outer(r, r) / float(step @ r)
    return 0.5 * (result + result.T)


def nearest_positive(H: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return H: (n, n) with its eigenvalues raised to a small positive number where they are below it.

    What is not finite is returned as it is: the check of the subproblem's data then names it.
    """
    if not np.isfinite(H).all():
        return H
    values, vectors = np.linalg.eigh(0.5 * (H + H.T))
    floor = SMALLEST_EIGENVALUE * max(1.0, float(np.abs(values).max()))
    raised = np.maximum(values, floor)
    result: NDArray[np.float64] = (vectors * raised) @ vectors.T
    return 0.5 * (result + result.T)
