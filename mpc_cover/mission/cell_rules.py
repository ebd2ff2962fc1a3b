"""Cells stand for area only where they are small beside the sensing radius: the point that is measured is one of many.

A cell whose centroid is at distance rho counts as measured, though its far corner is half a diagonal farther away.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.errors import Problem
from mpc_cover.mission.field import bounding_box
from mpc_cover.mission.fleet import agent_value

if TYPE_CHECKING:
    from collections.abc import Iterator

    from mpc_cover.arrays import FloatArray
    from mpc_cover.mission.config import MissionSpec

WARN = 0.6
"""Half diagonals above this part of the smallest radius are warned of: strips rho wide may then lack a third of a cell.

A plain choice: box-3 has 0.35.
"""


def half_diagonal(spec: MissionSpec) -> float:
    """Return half the diagonal of a cell, as much of it as fits in W's bounding box [m]."""
    lower, upper = bounding_box(spec.area.shape)
    return 0.5 * float(np.linalg.norm(np.minimum(upper - lower, spec.area.cell_size_m)))


def coarse_problems(spec: MissionSpec) -> Iterator[Problem]:
    """Yield a problem where no agent in a cell's middle sees all of the cell: its measurement would mean nothing."""
    half, size = half_diagonal(spec), spec.area.cell_size_m
    for name in spec.magnitudes:
        largest = float(_radii(spec, name).max(initial=0.0))
        if 0.0 < largest < half * (1.0 - 1e-9):
            right = (
                f"is too coarse for sensing radii of {largest:g} m ({name}): an agent in the middle of a cell must see "
                f"all of it: must be at most {_most(spec, largest, size, half):.3g}"
            )
            yield Problem("area.cell_size_m", size, right)
            return


def coarse_warning(spec: MissionSpec) -> str | None:
    """Return what there is to say of cells that the fleet's radii hardly bear; None of finer ones."""
    half, size = half_diagonal(spec), spec.area.cell_size_m
    least = min((float(radii.min()) for name in spec.magnitudes if (radii := _radii(spec, name)).size), default=np.inf)
    if half <= WARN * least:
        return None
    return (
        f"area.cell_size_m: {size:g}: is coarse for a sensing radius of {least:g} m: a cell that counts as covered may "
        f"be out of range by {half:.3g} m in part; at most {_most(spec, WARN * least, size, half):.3g} would be fine"
    )


def _most(spec: MissionSpec, reach: float, size: float, half: float) -> float:
    """Return the greatest cell size of which half a diagonal is `reach` [m], for cells inside the bounding box."""
    lower, _ = bounding_box(spec.area.shape)
    return min(2.0 * reach / float(np.sqrt(lower.size)), size * reach / half)


def _radii(spec: MissionSpec, magnitude: str) -> FloatArray:
    """Return the sensing radii [m] of the agents that measure a magnitude."""
    given = [agent_value(spec, agent, "sensing_radius_m") for agent in spec.fleet.agents]
    own = [radius.get(magnitude) if isinstance(radius, dict) else radius for radius in given]
    return np.array([radius for radius in own if isinstance(radius, float)])
