"""Bounds on single variables: the motion box (4.15, 4.16), the trust region, and the end state (4.17)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.constraints.rows import Layout, Rows

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray


def bound_rows(
    layout: Layout,
    position: FloatArray,
    box: tuple[FloatArray, FloatArray],
    trust: float,
    end_position: FloatArray | None,
    end_velocity: FloatArray,
) -> Rows:
    """Return bounds on all positions, and equalities for the end.

    `position` is the iterate (N+1, m, d) [m], which `trust` [m] keeps near; `box` the corners (d,) [m];
    `end_position` (m, d) [m] or None when it is free; `end_velocity` (m, d) [m/s], zero for an end at rest.
    An iterate outside the box may stay where it is, but goes no farther out.
    """
    iterate = position[1:]
    lower = np.maximum(iterate - trust, np.minimum(box[0], iterate))
    upper = np.minimum(iterate + trust, np.maximum(box[1], iterate))
    stage = layout.agents * layout.dimension
    if end_position is not None:
        lower[-1] = upper[-1] = end_position
    column = np.concatenate([np.arange(layout.half), layout.size - stage + np.arange(stage)])
    end = end_velocity.ravel()
    return Rows(
        row=np.arange(column.size),
        column=column,
        value=np.ones(column.size),
        lower=np.concatenate([lower.ravel(), end]),
        upper=np.concatenate([upper.ravel(), end]),
    )
