"""The sampled double integrator as equalities between positions and velocities (3.17, 4.23)."""

from __future__ import annotations

import numpy as np

from mpc_cover.constraints.rows import Layout, Rows


def dynamics_rows(layout: Layout, period: float) -> Rows:
    """Return q(n+1) - q(n) = T_s/2 (v(n) + v(n+1)), which the zero-order hold gives once u is eliminated."""
    half, stage = layout.half, layout.agents * layout.dimension
    base = np.arange(half - stage)
    ones, slope = np.ones(base.size), np.full(base.size, -0.5 * period)
    zero = np.zeros(base.size)
    return Rows(
        row=np.tile(base, 4),
        column=np.concatenate([base + stage, base, half + base + stage, half + base]),
        value=np.concatenate([ones, -ones, slope, slope]),
        lower=zero,
        upper=zero.copy(),
    )
