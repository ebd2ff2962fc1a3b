"""Trajectories over the coverage map: uncovered cells are dark, as in the thesis's figures 4.2 to 4.4."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.markers import MarkerStyle
from matplotlib.patches import Circle, PathPatch, Rectangle
from matplotlib.path import Path as Outline
from matplotlib.transforms import Affine2D

from mpc_cover.mission.config import BoxShape, DiscShape, PolygonShape
from mpc_cover.verification.coverage_claim import first_measured
from mpc_cover.verification.information_summary import age_history
from mpc_cover.verification.path import Path
from mpc_cover.view.cells import Scale, draw_pixels
from mpc_cover.view.information import is_patrol, meaning_of_dark
from mpc_cover.view.style import COVERED, INK, QUIET, UNCOVERED, agent_style, outlined

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.patches import Patch

    from mpc_cover.arrays import FloatArray, IntArray
    from mpc_cover.mission.config import Shape
    from mpc_cover.trajectory_file import Recording

_SHADE = LinearSegmentedColormap.from_list("coverage", [COVERED, UNCOVERED])
_TIE = 1e-9
_ARROWS = 6
"""Arrow heads on each path."""
_LABELLED = 16
"""With more agents than this, ids would hide the map."""


def draw_map(axes: Axes, trajectory: Recording, magnitude: int | None = None) -> None:
    """Draw the cells, the area's outline, the paths, and the fleet at the end with its discs and tree.

    With a `magnitude` (index), what was measured of it, and only the agents that can measure it.
    """
    fleet = trajectory.mission.fleet
    able = np.arange(fleet.size) if magnitude is None else np.flatnonzero(fleet.radius[:, magnitude] > 0.0)
    draw_pixels(axes, trajectory.mission.field, _owed(trajectory, magnitude), Scale(_SHADE, 0.0, 1.0))
    _draw_area(axes, trajectory)
    if np.isfinite(fleet.communication_range):
        _draw_tree(axes, trajectory.position[-1])
    radius = fleet.radius.max(axis=1) if magnitude is None else fleet.radius[:, magnitude]
    _draw_paths(axes, trajectory, able)
    _draw_ends(axes, trajectory, able, radius)
    axes.set_aspect("equal")
    axes.grid(visible=False)
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")
    axes.set_title(_title(trajectory, magnitude))


def _title(trajectory: Recording, magnitude: int | None) -> str:
    names = trajectory.mission.fleet.magnitudes
    if magnitude is not None:
        name = names[magnitude]
        return name[:1].upper() + name[1:] if name.startswith("coverage") else f"Coverage of {name}"
    several = len(names) > 1
    dark = meaning_of_dark(trajectory.mission)
    if several and not is_patrol(trajectory.mission):
        dark = f"the darker, the more of {len(names)} magnitudes owed"
    flat = "; projected to x-y" if trajectory.mission.fleet.dimension > 2 else ""  # noqa: PLR2004 - space
    return f"Coverage ({dark}{flat})"


def _owed(trajectory: Recording, magnitude: int | None) -> FloatArray:
    """Return (K,): the part of the magnitudes still owed on each cell, or of a patrol's limit its age, 0 to 1."""
    radius = trajectory.mission.fleet.radius
    if is_patrol(trajectory.mission):
        history = age_history(trajectory)
        last = history.last_s if magnitude is None else history.last_s[[magnitude]]
        return np.asarray(np.clip(last / history.limit_s, 0.0, 1.0).mean(axis=0))
    if magnitude is None and radius.shape[1] == 1:
        return np.isinf(trajectory.covered_at).astype(float)
    columns = range(radius.shape[1]) if magnitude is None else [magnitude]
    owed = [np.isinf(first_measured(trajectory, radius[:, [j]] + _TIE)) for j in columns]
    return np.asarray(np.mean(owed, axis=0))


def _draw_area(axes: Axes, trajectory: Recording) -> None:
    """Draw the outline of W with its holes, and the box that agents stay in where it is another."""
    mission = trajectory.mission
    fleet, field = mission.fleet, mission.field
    axes.add_patch(_outline(mission.spec.area.shape))
    low, high = fleet.motion_min[:2], fleet.motion_max[:2]
    if not (np.allclose(low, field.shape_min[:2]) and np.allclose(high, field.shape_max[:2])):
        box = Rectangle((low[0], low[1]), *(high - low), fill=False, edgecolor=QUIET, linestyle=":", linewidth=1.2)
        axes.add_patch(box)
    # agents outside the box are shown, too
    flown = trajectory.position[..., :2].reshape(-1, 2)
    lower = np.min([low, field.shape_min[:2], flown.min(axis=0)], axis=0)
    upper = np.max([high, field.shape_max[:2], flown.max(axis=0)], axis=0)
    edge = 0.03 * float((upper - lower).max())
    axes.set_xlim(lower[0] - edge, upper[0] + edge)
    axes.set_ylim(lower[1] - edge, upper[1] + edge)


def _outline(shape: Shape) -> Patch:
    line: dict[str, Any] = {"fill": False, "edgecolor": INK, "linewidth": 1.6, "zorder": 1.0}
    match shape:
        case BoxShape():
            (x, y), (right, top) = shape.min_m[:2], shape.max_m[:2]
            return Rectangle((x, y), right - x, top - y, **line)
        case DiscShape():
            x, y = shape.center_m[:2]
            return Circle((x, y), shape.radius_m, **line)
        case PolygonShape():
            rings = (shape.outline_m, *shape.holes_m)
            closed = [Outline([*ring, ring[0]], closed=True) for ring in rings]
            return PathPatch(Outline.make_compound_path(*closed), **line)


def _draw_paths(axes: Axes, trajectory: Recording, agents: IntArray) -> None:
    path = Path(trajectory.time, trajectory.position, trajectory.velocity, trajectory.input)
    _, dense = path.dense(max(2, min(12, 6000 // len(trajectory.time))))
    for agent in agents:
        colour, line = agent_style(int(agent))
        axes.plot(
            *dense[:, agent, :2].T,
            color=colour,
            linestyle=line,
            linewidth=1.9,
            solid_capstyle="round",
            path_effects=outlined(3.2),
            zorder=3,
        )
        _draw_arrows(axes, dense[:, agent, :2], colour)


def _draw_arrows(axes: Axes, point: FloatArray, colour: str) -> None:
    """Draw arrow heads along a path of (Q, 2) points, evenly spaced on its length."""
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(point, axis=0), axis=1))])
    if length[-1] == 0.0:
        return
    count = _ARROWS + 1
    for goal in length[-1] * np.arange(1, count) / count:
        k = int(np.searchsorted(length, goal))
        ahead = point[k] - point[k - 1]
        turn = Affine2D().rotate(float(np.arctan2(ahead[1], ahead[0])))
        head = MarkerStyle(">", transform=turn)
        axes.plot(*point[k], marker=head, markersize=8, color=colour, markeredgecolor="white", zorder=3.5)


def _draw_ends(axes: Axes, trajectory: Recording, agents: IntArray, radius: FloatArray) -> None:
    """Draw the start (hollow), the end (filled) with the sensing disc, and the id."""
    for agent in agents:
        colour, _ = agent_style(int(agent))
        start, end = trajectory.position[0, agent, :2], trajectory.position[-1, agent, :2]
        disc = Circle((end[0], end[1]), radius[agent], facecolor=colour, edgecolor=colour, alpha=0.22, zorder=2)
        axes.add_patch(disc)
        axes.plot(
            *start, "o", markersize=7, markerfacecolor="white", markeredgecolor=colour, markeredgewidth=2, zorder=4
        )
        axes.plot(
            *end, "o", markersize=9, markerfacecolor=colour, markeredgecolor="white", markeredgewidth=1.2, zorder=5
        )
        if len(agents) <= _LABELLED:
            axes.annotate(
                trajectory.agent_id[agent],
                (end[0], end[1]),
                xytext=(8, 7),
                textcoords="offset points",
                fontweight="bold",
                path_effects=outlined(3.0),
                zorder=6,
            )


def _draw_tree(axes: Axes, position: FloatArray) -> None:
    """Draw the edges of the Euclidean minimum spanning tree of (m, d) positions [m]."""
    edges = [position[list(edge), :2] for edge in spanning_tree(position)]
    axes.add_collection(LineCollection(edges, colors=INK, linewidths=1.1, linestyles=(0, (3, 2)), zorder=2.5))


def spanning_tree(position: FloatArray) -> list[tuple[int, int]]:
    """Return the m - 1 edges of the Euclidean minimum spanning tree of (m, d) positions (Prim)."""
    distance = np.linalg.norm(position[:, None] - position[None], axis=2)
    near, parent = distance[0].copy(), np.zeros(len(position), dtype=int)
    near[0] = np.inf
    edges = []
    for _ in range(len(position) - 1):
        new = int(np.argmin(near))
        edges.append((int(parent[new]), new))
        closer = (distance[new] < near) & np.isfinite(near)
        near[closer], parent[closer] = distance[new][closer], new
        near[new] = np.inf
    return edges
