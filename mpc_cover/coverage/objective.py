"""The exact coverage objective (thesis 4.34 with the erratum of 4.30)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.coverage.nearest import nearest_samples
from mpc_cover.model.sensing import TIE

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray, IntArray
    from mpc_cover.model.look_instants import InterSample


def coverage_cost(
    position: FloatArray,
    cell: FloatArray,
    radius: FloatArray,
    weight: FloatArray,
    looks: IntArray | None = None,
    between: InterSample | None = None,
) -> float:
    """Return J = sum_j sum_k gamma_jk pos(min_(i,n) (||q_i(n) - p_k|| - rho_j^(i))) [m]  (4.34).

    `position` is (N+1, m, d) [m]; `cell` (K, d) [m]; `radius` (m, J) [m], -inf where an agent cannot
    measure a magnitude; `weight` (J, K) is gamma. A pair with r outstanding `looks` (J, K) costs the sum of its r
    smallest values, each through pos. `between` are looks between samples, as in `nearest.nearest_samples`.
    A cell within a rounding error of a sensing disc counts as inside, as in `model.sensing.measured`: J is 0
    exactly when nothing is left uncovered.
    """
    nearest = nearest_samples(position, cell, radius, weight, 1, looks, between)
    excess = nearest.excess[:, 0]
    return float(nearest.weight @ np.where(excess > TIE, excess, 0.0))
