"""Trajectories over the coverage map: when each cell was covered; dark where never (thesis, figures 4.2 to 4.4)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.colors import LinearSegmentedColormap, ListedColormap
from matplotlib.patches import Circle, PathPatch, Rectangle
from matplotlib.path import Path as Outline

from mpc_cover.mission.config import BoxShape, DiscShape, PolygonShape
from mpc_cover.verification.coverage_claim import first_measured
from mpc_cover.verification.information_summary import age_history
from mpc_cover.view.cells import Scale, draw_pixels
from mpc_cover.view.information import is_patrol, meaning_of_dark
from mpc_cover.view.map_agents import draw_agents
from mpc_cover.view.style import COVERED, INK, QUIET, UNCOVERED

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.patches import Patch

    from mpc_cover.arrays import FloatArray
    from mpc_cover.mission.config import Shape
    from mpc_cover.trajectory_file import Recording

_AGES = LinearSegmentedColormap.from_list("ages", [COVERED, UNCOVERED])
_TIMES = LinearSegmentedColormap.from_list("times", ["#fbf4e1", "#d8e6cf", "#a3c9c4", "#7ba6bd", "#7288ad"])
"""Colours of early to late times, light enough for paths to be seen on; what was never covered is drawn below them."""
_TIE = 1e-9


def draw_map(axes: Axes, trajectory: Recording, magnitude: int | None = None) -> None:
    """Draw when each cell was covered, the area's outline, the paths, and the fleet at the end with discs and tree.

    With a `magnitude` (index), when it was measured, and only the agents that can measure it. Of a patrol the ages of
    the looks are drawn instead.
    """
    fleet = trajectory.mission.fleet
    able = np.arange(fleet.size) if magnitude is None else np.flatnonzero(fleet.radius[:, magnitude] > 0.0)
    if is_patrol(trajectory.mission):
        draw_pixels(axes, trajectory.mission.field, _ages(trajectory, magnitude), Scale(_AGES, 0.0, 1.0))
    else:
        _draw_times(axes, trajectory, magnitude)
    _draw_area(axes, trajectory)
    axes.set_aspect("equal")
    axes.grid(visible=False)
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")
    axes.set_title(_title(trajectory, magnitude))
    radius = fleet.radius.max(axis=1) if magnitude is None else fleet.radius[:, magnitude]
    draw_agents(axes, trajectory, able, radius)


def _title(trajectory: Recording, magnitude: int | None) -> str:
    names = trajectory.mission.fleet.magnitudes
    flat = "; projected to x-y" if trajectory.mission.fleet.dimension > 2 else ""  # noqa: PLR2004 - space
    dark = f"({meaning_of_dark(trajectory.mission)}{flat})"
    if is_patrol(trajectory.mission):
        return f"Ages of looks {dark}" if magnitude is None else f"Ages of looks: {names[magnitude]}"
    if magnitude is not None:
        return f"When covered: {names[magnitude]}"
    return f"When each cell was covered {dark}"


def _ages(trajectory: Recording, magnitude: int | None) -> FloatArray:
    """Return (K,): the age of each cell's last look at the end, as a part of the limit, 0 to 1."""
    history = age_history(trajectory)
    last = history.last_s if magnitude is None else history.last_s[[magnitude]]
    return np.asarray(np.clip(last / history.limit_s, 0.0, 1.0).mean(axis=0))


def _draw_times(axes: Axes, trajectory: Recording, magnitude: int | None) -> None:
    """Draw when each cell was covered, with a colour bar; what never was is dark."""
    time, field = trajectory.covered_at, trajectory.mission.field
    if magnitude is not None and trajectory.mission.fleet.radius.shape[1] > 1:
        time = first_measured(trajectory, trajectory.mission.fleet.radius[:, [magnitude]] + _TIE)
    begin, end = float(trajectory.time[0]), float(trajectory.time[-1])
    never = ListedColormap([UNCOVERED])
    draw_pixels(axes, field, np.isinf(time).astype(float), Scale(never.with_extremes(under="none"), 0.5, 1.0))
    scale = Scale(_TIMES, begin, max(end, begin + _TIE))
    image = draw_pixels(axes, field, np.where(np.isinf(time), np.nan, time), scale)
    axes.figure.colorbar(image, ax=axes, label="covered at [s]", location="bottom", shrink=0.6, pad=0.02, aspect=40)


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
