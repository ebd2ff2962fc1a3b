"""Agents on a map: their paths, where they end or were lost, their ids, and the tree that connects them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.markers import MarkerStyle
from matplotlib.patches import Circle
from matplotlib.transforms import Affine2D, Bbox

from mpc_cover.verification.losses import losses_of
from mpc_cover.verification.path import Path
from mpc_cover.view.style import INK, agent_style, outlined

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.text import Annotation

    from mpc_cover.arrays import FloatArray, IntArray
    from mpc_cover.trajectory_file import Recording

_ARROWS = 6
"""Arrow heads on each path."""
_LABELLED = 16
"""With more agents than this, ids would hide the map."""
_SIDES = tuple((side, height) for side in ("left", "right", "center") for height in ("bottom", "top"))
"""Alignments of an id beside its agent, in the order in which they are tried."""


def draw_agents(axes: Axes, trajectory: Recording, agents: IntArray, radius: FloatArray) -> None:
    """Draw the paths of some agents (indices), and the whole fleet's tree at the end.

    `radius` (m,) [m] is that of the discs around those that are not lost at the end. The axes have their limits.
    """
    losses = losses_of(trajectory)
    if np.isfinite(trajectory.mission.fleet.communication_range):
        living = [agent for agent in range(len(trajectory.agent_id)) if agent not in losses]
        _draw_tree(axes, trajectory.position[-1, living])
    _draw_paths(axes, trajectory, agents)
    _draw_ends(axes, trajectory, agents, radius, losses)


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


def _draw_ends(
    axes: Axes, trajectory: Recording, agents: IntArray, radius: FloatArray, losses: dict[int, float]
) -> None:
    """Draw the start (hollow), the end (filled) with the sensing disc, a cross where an agent was lost, and ids."""
    for agent in agents:
        colour, _ = agent_style(int(agent))
        start, end = trajectory.position[0, agent, :2], trajectory.position[-1, agent, :2]
        axes.plot(
            *start, "o", markersize=7, markerfacecolor="white", markeredgecolor=colour, markeredgewidth=2, zorder=4
        )
        if int(agent) in losses:
            axes.plot(
                *end, "X", markersize=12, markerfacecolor=INK, markeredgecolor=colour, markeredgewidth=1.4, zorder=5
            )
            continue
        disc = Circle((end[0], end[1]), radius[agent], facecolor=colour, edgecolor=colour, alpha=0.22, zorder=2)
        axes.add_patch(disc)
        axes.plot(
            *end, "o", markersize=9, markerfacecolor=colour, markeredgecolor="white", markeredgewidth=1.2, zorder=5
        )
    if len(agents) <= _LABELLED:
        lost = {agent: f" lost at {time:.1f} s" for agent, time in losses.items()}
        names = [trajectory.agent_id[agent] + lost.get(int(agent), "") for agent in agents]
        _label(axes, trajectory.position[-1, agents, :2], names)


def _label(axes: Axes, place: FloatArray, names: list[str]) -> None:
    """Write names beside (n, 2) places, each on the side where it overlaps others, markers and the border least."""
    taken: list[Bbox] = []
    for point, name in zip(place, names, strict=True):
        boxes = []
        for horizontal, vertical in _SIDES:
            text = _write(axes, point, name, horizontal, vertical)
            boxes.append(text.get_window_extent())
            text.remove()
        overlap = [_overlap(box, axes, taken, place) for box in boxes]
        best = int(np.argmin(overlap))
        taken.append(boxes[best])
        _write(axes, point, name, *_SIDES[best])


def _write(axes: Axes, point: FloatArray, name: str, horizontal: str, vertical: str) -> Annotation:
    """Write a name beside a point, aligned as given."""
    away = {"left": 8, "right": -8, "center": 0, "bottom": 7, "top": -7}
    return axes.annotate(
        name,
        (point[0], point[1]),
        xytext=(away[horizontal], away[vertical] * (2 if horizontal == "center" else 1)),
        textcoords="offset points",
        ha=horizontal,
        va=vertical,
        fontweight="bold",
        path_effects=outlined(3.0),
        zorder=6,
    )


def _overlap(box: Bbox, axes: Axes, taken: list[Bbox], place: FloatArray) -> float:
    """Return by how many square pixels a box overlaps others, what juts out of the axes, and the markers in it."""
    frame = axes.get_window_extent()
    markers = axes.transData.transform(place)
    inside = ((markers > box.min) & (markers < box.max)).all(axis=1).sum()
    others = sum(_area(Bbox.intersection(box, other)) for other in taken)
    return others + _area(box) - _area(Bbox.intersection(box, frame)) + float(inside) * _area(box)


def _area(box: Bbox | None) -> float:
    return 0.0 if box is None else float(box.width * box.height)


def _draw_tree(axes: Axes, position: FloatArray) -> None:
    """Draw the edges of the Euclidean minimum spanning tree of (m, d) positions [m]."""
    edges = [position[list(edge), :2] for edge in spanning_tree(position)] if len(position) else []
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
