"""The coverage objective, exactly (thesis 4.34 with the erratum of 4.30)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.coverage.nearest import nearest_samples

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray, IntArray


def coverage_cost(
    position: FloatArray, cell: FloatArray, radius: FloatArray, weight: FloatArray, looks: IntArray | None = None
) -> float:
    """Return J = sum_j sum_k gamma_jk pos(min_(i,n) (||q_i(n) - p_k|| - rho_j^(i))) [m]  (4.34).

    `position` is (N+1, m, d) [m]; `cell` (K, d) [m]; `radius` (m, J) [m], -inf where an agent cannot
    measure a magnitude; `weight` (J, K) is gamma. A pair that is owed r `looks` (J, K) costs the sum of its r
    smallest values, each through pos.
    """
    nearest = nearest_samples(position, cell, radius, weight, 1, looks)
    return float(nearest.weight @ np.maximum(nearest.excess[:, 0], 0.0))
