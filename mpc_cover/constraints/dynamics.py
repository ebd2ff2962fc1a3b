"""The sampled double integrator as equalities between positions and velocities (3.17, 4.23)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.constraints.rows import Layout, Rows

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray


def dynamics_rows(layout: Layout, position: FloatArray, velocity: FloatArray, period: float) -> Rows:
    """Return q(n+1) - q(n) = T_s/2 (v(n) + v(n+1)), which the zero-order hold gives once u is eliminated.

    `position` and `velocity` are the given (m, d) state at sample 0 [m], [m/s].
    """
    half, stage = layout.half, layout.agents * layout.dimension
    base = np.arange(half)
    later = base[stage:]
    slope = 0.5 * period
    right = np.zeros(half)
    right[:stage] = (position + slope * velocity).ravel()
    return Rows(
        row=np.concatenate([base, later, base, later]),
        column=np.concatenate([base, later - stage, half + base, half + later - stage]),
        value=np.concatenate(
            [np.ones(half), -np.ones(half - stage), np.full(half, -slope), np.full(half - stage, -slope)]
        ),
        lower=right,
        upper=right.copy(),
    )
