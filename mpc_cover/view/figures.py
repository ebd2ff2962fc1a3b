"""All figures of a run, and an overview of them."""

from __future__ import annotations

import math
import re
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from mpc_cover.errors import UserError
from mpc_cover.mission.config import Dynamics
from mpc_cover.verification.summary import floor_percent, time_for_a_step
from mpc_cover.view.information import draw_ages, headline_of_patrol, is_patrol
from mpc_cover.view.maps import draw_map
from mpc_cover.view.series import (
    draw_altitudes,
    draw_coverage,
    draw_distances,
    draw_inputs,
    draw_speeds,
    draw_step_times,
)
from mpc_cover.view.style import GOOD, INK, LIMIT, house_style, new_figure, save_figure

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, FigureBase

    from mpc_cover.arrays import FloatArray
    from mpc_cover.trajectory_file import Recording
    from mpc_cover.verification.report import Report

    Draw = Callable[[Axes], None]

FIGURES = tuple(
    f"{name}.png"
    for name in ("overview", "map", "map-*", "coverage", "speeds", "altitudes", "ages", "inputs", "distances", "steps")
)
"""Names of all files that `draw_run` may write, as patterns."""
_NAMED = 16
"""With more agents than this a legend would crowd out the curves."""


def draw_run(
    trajectory: Recording,
    folder: str | Path,
    step_times: FloatArray | None = None,
    report: Report | None = None,
) -> list[Path]:
    """Write a run's or a plan's figures as PNG into `folder`, which is created if needed.

    Parameters
    ----------
    step_times : (S,) [s], durations of the controller's steps; without it there is no such figure.
    report : the verifier's; the overview shows its result.

    Returns
    -------
    The files written, the overview first.

    Raises
    ------
    UserError
        The folder cannot be written.
    """
    target = Path(folder)
    steps = step_times if step_times is not None and step_times.size else None
    try:
        target.mkdir(parents=True, exist_ok=True)
        with house_style():
            return [save_figure(figure, target / name) for name, figure in _figures(trajectory, steps, report)]
    except OSError as error:
        raise UserError(f"figures: cannot write to {target}: {error.strerror or error}") from None


def _figures(
    trajectory: Recording, step_times: FloatArray | None, report: Report | None
) -> Iterator[tuple[str, Figure]]:
    """Yield each figure with its file's name."""
    yield "overview.png", draw_overview(trajectory, step_times, report)
    yield "map.png", _single(lambda axes: draw_map(axes, trajectory), 7.5, 7.2)
    for index, name in _magnitudes(trajectory):
        yield (
            f"map-{re.sub('[^A-Za-z0-9_.]+', '-', name)}.png",
            _single(partial(draw_map, trajectory=trajectory, magnitude=index), 7.5, 7.2),
        )
    for name, draw in _panels(trajectory, step_times).items():
        yield f"{name}.png", _single(draw, 8.6, 4.4)


def _panels(trajectory: Recording, step_times: FloatArray | None) -> dict[str, Draw]:
    """Return the panels over time, by name."""
    panels: dict[str, Draw] = {
        "coverage": lambda axes: draw_coverage(axes, trajectory),
        "speeds": lambda axes: draw_speeds(axes, trajectory),
    }
    if trajectory.mission.fleet.dimension > 2:  # noqa: PLR2004 - space
        panels["altitudes"] = lambda axes: draw_altitudes(axes, trajectory)
    if is_patrol(trajectory.mission):
        panels["ages"] = lambda axes: draw_ages(axes, trajectory)
    if trajectory.mission.spec.fleet.dynamics is not Dynamics.SINGLE:  # their speed is their input
        panels["inputs"] = lambda axes: draw_inputs(axes, trajectory)
    if len(trajectory.agent_id) > 1:
        panels["distances"] = lambda axes: draw_distances(axes, trajectory)
    if step_times is not None:
        period = time_for_a_step(trajectory)
        panels["steps"] = lambda axes: draw_step_times(axes, step_times, period)
    return panels


_MAPS = 4
"""Magnitudes that the overview has room for; each has a picture of its own as well."""


def _magnitudes(trajectory: Recording) -> list[tuple[int, str]]:
    """Return (index, name) of each magnitude where there are several."""
    names = trajectory.mission.fleet.magnitudes
    return list(enumerate(names)) if len(names) > 1 else []


def _single(draw: Draw, width: float, height: float) -> Figure:
    """Return a figure of its own, with the agents' names beside it if they are few."""
    figure = new_figure(width, height)
    axes = figure.add_subplot()
    draw(axes)
    handles, names = axes.get_legend_handles_labels()
    if axes.get_legend() is None and 1 < len(names) <= _NAMED:
        figure.legend(handles, names, loc="outside right upper", fontsize=10.5)
    return figure


def draw_overview(trajectory: Recording, step_times: FloatArray | None, report: Report | None) -> Figure:
    """Draw all panels in one picture: the map on the left, what changes over time on the right."""
    magnitudes = _magnitudes(trajectory)[:_MAPS]
    figure = new_figure(14.0, 12.4 if magnitudes else 7.9)
    top: FigureBase = figure
    if magnitudes:
        top, bottom = figure.subfigures(2, 1, squeeze=False, height_ratios=(2.0, 1.0)).ravel()
        for axes, (index, _) in zip(bottom.subplots(1, len(magnitudes)), magnitudes, strict=True):
            draw_map(axes, trajectory, index)
    left, right = top.subfigures(1, 2, squeeze=False, width_ratios=(1.08, 1.0)).ravel()
    draw_map(left.add_subplot(), trajectory)
    panels = list(_panels(trajectory, step_times).values())
    grid = right.add_gridspec((len(panels) + 1) // 2, 2)
    # an odd one gets the whole width, at the top
    places = [grid[0, :]] if len(panels) % 2 else []
    places += [grid[row, column] for row in range(len(places), grid.nrows) for column in range(2)]
    for draw, place in zip(panels, places, strict=True):
        draw(right.add_subplot(place))
    text, colour = _headline(trajectory, report)
    figure.suptitle(text, color=colour, fontsize=13.5, fontweight="bold")
    return figure


def _headline(trajectory: Recording, report: Report | None) -> tuple[str, str]:
    """Return the headline of the overview, and its colour."""
    cells = trajectory.covered_at.size
    covered = floor_percent(sum(math.isfinite(time) for time in trajectory.covered_at), cells)
    kind = trajectory.meta.get("kind", "run")
    done = f"{covered:g} % covered in {trajectory.time[-1]:.1f} s"
    if is_patrol(trajectory.mission):
        done = headline_of_patrol(trajectory)
    text = f"{trajectory.mission.spec.name}, {kind}: {done}"
    short = covered < 100.0 and not is_patrol(trajectory.mission)  # noqa: PLR2004 - percent
    if report is None:
        return text, LIMIT if short else INK
    if (failure := report.first_failure) is not None:
        return f"{text}\nVIOLATION: {failure.name}, {failure.where}", LIMIT
    if short:
        return f"NOT COMPLETE: {text}; all {len(report.checks)} checks hold", LIMIT
    return f"{text}; verified, all {len(report.checks)} checks hold", GOOD
