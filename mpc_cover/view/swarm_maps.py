"""Snapshots of a swarm over a map of its cells: residual information, or a field and its estimate."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.patches import Circle

from mpc_cover.view.cells import Scale, draw_pixels
from mpc_cover.view.style import COVERED, INK, UNCOVERED, agent_style, outlined

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.image import AxesImage

    from mpc_cover.arrays import BoolArray, FloatArray
    from mpc_cover.mission.field import Field
    from mpc_cover.view.swarm_run import SwarmRun

OWED: Any = LinearSegmentedColormap.from_list("owed", [COVERED, "#8d9aa0", UNCOVERED])
"""Settled is light, owed is dark, as in the coverage maps."""
VALUE = "viridis"
"""Fields and their estimates."""
TRAIL_S = 4.0
"""How much of the past a snapshot shows [s]."""


def draw_cells(axes: Axes, field: Field, value: FloatArray, scale: Scale) -> AxesImage:
    """Draw (K,) values as pixels, W's edge around them; cells above each other share one, with their mean."""
    lower = field.shape_min[:2]
    image = draw_pixels(axes, field, value, scale)
    axes.set_aspect("equal")
    axes.grid(visible=False)
    margin = 0.03 * float((field.shape_max - field.shape_min)[:2].max())
    axes.set_xlim(lower[0] - margin, field.shape_max[0] + margin)
    axes.set_ylim(lower[1] - margin, field.shape_max[1] + margin)
    return image


def draw_swarm(axes: Axes, run: SwarmRun, time: float, watched: int | None = None, *, discs: bool = True) -> None:
    """Draw the agents at a time [s] with their last seconds, their discs, and the edges they keep.

    The `watched` agent, whose map is shown, is the bigger dot.
    """
    path = run.path
    sample = int(np.searchsorted(path.time, time - 1e-9))
    begin = int(np.searchsorted(path.time, time - TRAIL_S - 1e-9))
    draw_edges(axes, path.position[sample], run.kept[sample])
    for agent in range(path.position.shape[1]):
        colour, line = agent_style(agent)
        trail, here = path.position[begin : sample + 1, agent, :2], path.position[sample, agent, :2]
        axes.plot(*trail.T, color=colour, linestyle=line, linewidth=1.5, path_effects=outlined(2.6), zorder=3)
        if discs:
            radius = float(run.fleet.radius[agent].max())
            axes.add_patch(Circle((here[0], here[1]), radius, fill=False, edgecolor=colour, linewidth=0.9, zorder=2.5))
        size = 11.0 if agent == watched else 6.0
        axes.plot(*here, "o", markersize=size, color=colour, markeredgecolor="white", markeredgewidth=1.1, zorder=5)


def draw_edges(axes: Axes, position: FloatArray, kept: BoolArray) -> None:
    """Draw the edges (m, m) that one end keeps at the least, between (m, d) positions [m]."""
    edges = [position[[i, j], :2] for i, j in np.argwhere(np.triu(kept | kept.T))]
    if edges:
        lines = LineCollection(edges, colors=INK, linewidths=1.5, path_effects=outlined(3.0), zorder=2.8)
        axes.add_collection(lines)


def moments(run: SwarmRun, count: int) -> list[int]:
    """Return indices of recorded maps: the first, the last, and others evenly between them in time."""
    time = run.maps.time
    wanted = np.linspace(time[0], time[-1], count)
    return sorted({int(np.argmin(np.abs(time - moment))) for moment in wanted})


def name_axes(axes: Axes, *, left: bool, bottom: bool) -> None:
    """Label the outer axes of a grid of maps only."""
    axes.set_xlabel("x [m]" if bottom else "")
    axes.set_ylabel("y [m]" if left else "")
    axes.tick_params(labelbottom=bottom, labelleft=left)


def add_scale(figure: Figure, image: AxesImage, axes: list[Axes], label: str) -> None:
    """Put the colours' scale on the right of some axes."""
    bar = figure.colorbar(image, ax=axes, shrink=0.9, pad=0.015, aspect=28)
    bar.set_label(label)
    bar.outline.set_visible(False)
