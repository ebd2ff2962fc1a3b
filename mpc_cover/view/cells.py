"""Values of cells as pixels."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.image import AxesImage

    from mpc_cover.arrays import FloatArray
    from mpc_cover.mission.field import Field


@dataclass(frozen=True)
class Scale:
    """Colours and their bounds."""

    colours: Any
    low: float
    high: float


def draw_pixels(axes: Axes, field: Field, value: FloatArray, scale: Scale) -> AxesImage:
    """Draw (K,) values as pixels; cells above each other share one, with the mean of those that are numbers."""
    lower, size = field.shape_min[:2], field.cell_size
    place = np.floor((field.cell[:, :2] - lower) / size + 1e-9).astype(int)
    count = place.max(axis=0) + 1
    total, cells = np.zeros(count), np.zeros(count)
    known = ~np.isnan(value)
    np.add.at(total, tuple(place[known].T), value[known])
    np.add.at(cells, tuple(place[known].T), 1.0)
    shade = np.divide(total, cells, out=np.full(count, np.nan), where=cells > 0.0)
    right, top = lower + count * size
    return axes.imshow(
        np.ma.masked_invalid(shade.T),
        cmap=scale.colours,
        vmin=scale.low,
        vmax=scale.high,
        origin="lower",
        extent=(lower[0], right, lower[1], top),
        interpolation="nearest",
        zorder=0,
    )
