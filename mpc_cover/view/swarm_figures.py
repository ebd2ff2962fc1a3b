"""The figures of chapters 5 and 6 of the thesis, reproduced from our own runs, one function each."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.view.cells import Scale
from mpc_cover.view.style import new_figure
from mpc_cover.view.swarm_maps import (
    OWED,
    VALUE,
    add_scale,
    draw_cells,
    draw_swarm,
    moments,
    name_axes,
)
from mpc_cover.view.swarm_series import draw_distances, draw_known, draw_left

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from mpc_cover.arrays import FloatArray
    from mpc_cover.view.swarm_run import SwarmRun

SNAPSHOTS = 8


def figure_5_1(run: SwarmRun) -> Figure:
    """Draw K-coverage: configurations and the residual information map over time."""
    return _residual_grid(run, run.maps.true, None, "K-coverage: residual information, global knowledge")


def figure_5_2(run: SwarmRun) -> Figure:
    """Draw K-coverage: the residual information of all cells over time."""
    figure = new_figure(8.6, 4.4)
    axes = figure.add_subplot()
    draw_left(axes, run)
    axes.set_title("K-coverage: residual information of all cells")
    return figure


def figure_5_3(run: SwarmRun) -> Figure:
    """Draw stochastic coverage: the field to be estimated, and the residual information over time."""
    figure = new_figure(12.4, 4.8)
    left, right = figure.subfigures(1, 2, squeeze=False, width_ratios=(1.0, 1.45)).ravel()
    axes = left.add_subplot()
    image = draw_cells(axes, run.field, run.truth, _field_scale(run))
    name_axes(axes, left=True, bottom=True)
    axes.set_title("(a) Field x, to be estimated")
    bar = left.colorbar(image, ax=axes, shrink=0.85, pad=0.02)
    bar.set_label("x")
    axes = right.add_subplot()
    draw_left(axes, run)
    axes.set_title("(b) " + axes.get_title(loc="left"))
    return figure


def figure_5_4(run: SwarmRun) -> Figure:
    """Draw stochastic coverage: residual information above, the estimate of the field below, over time."""
    return _stochastic_grid(run, run.maps.true, 0, None, "Stochastic coverage, global knowledge")


def figure_6_2(run: SwarmRun, watched: int = 0) -> Figure:
    """Draw constrained K-coverage: the map of one agent (the bigger dot), and the edges that are kept."""
    name = run.fleet.ids[watched]
    title = f"K-coverage with constraints: residual information as {name} (the bigger dot) knows it; edges kept"
    return _residual_grid(run, run.maps.own[:, watched], watched, title)


def figure_6_3(run: SwarmRun, global_run: SwarmRun, watched: int = 0) -> Figure:
    """Draw constrained K-coverage: distances, and what is left against the case of global knowledge."""
    figure = new_figure(13.4, 4.8)
    left, right = figure.subplots(1, 2)
    draw_distances(left, run)
    left.set_title("(a) " + left.get_title(loc="left"))
    draw_known(right, run, global_run, watched)
    right.set_title("(b) " + right.get_title(loc="left"))
    return figure


def figure_6_4(run: SwarmRun, global_run: SwarmRun, watched: int = 0) -> Figure:
    """Draw constrained stochastic coverage: distances, and what is left against the case of global knowledge."""
    return figure_6_3(run, global_run, watched)


def figure_6_5(run: SwarmRun, watched: int = 0) -> Figure:
    """Draw constrained stochastic coverage: residual information and estimate of one agent (the bigger dot)."""
    title = f"Stochastic coverage with constraints, as {run.fleet.ids[watched]} (the bigger dot) knows it; edges kept"
    return _stochastic_grid(run, run.maps.own[:, watched], watched, watched, title)


def _residual_grid(run: SwarmRun, gamma: FloatArray, watched: int | None, title: str) -> Figure:
    """Return two rows of maps (S, K) over time."""
    figure = new_figure(14.6, 7.7)
    grid = figure.subplots(2, SNAPSHOTS // 2, squeeze=False)
    scale = Scale(OWED, 0.0, float(gamma.max()))
    for place, index in enumerate(moments(run, SNAPSHOTS)):
        axes = grid.flat[place]
        image = draw_cells(axes, run.field, gamma[index], scale)
        draw_swarm(axes, run, run.maps.time[index], watched)
        axes.set_title(_caption(run, gamma, index))
        name_axes(axes, left=place % (SNAPSHOTS // 2) == 0, bottom=place >= SNAPSHOTS // 2)
    add_scale(figure, image, list(grid.flat), r"residual information $\gamma$")
    figure.suptitle(title, fontweight="bold", fontsize=13.0)
    return figure


def _stochastic_grid(run: SwarmRun, gamma: FloatArray, agent: int, watched: int | None, title: str) -> Figure:
    """Return a row of maps (S, K) of the residual information, and one of the agent's estimates below it."""
    count = SNAPSHOTS // 2
    figure = new_figure(14.6, 7.7)
    grid = figure.subplots(2, count, squeeze=False)
    scales = (Scale(OWED, 0.0, float(gamma.max())), _field_scale(run))
    for place, index in enumerate(moments(run, count)):
        top, bottom = grid[:, place]
        above = draw_cells(top, run.field, gamma[index], scales[0])
        draw_swarm(top, run, run.maps.time[index], watched)
        top.set_title(_caption(run, gamma, index))
        below = draw_cells(bottom, run.field, run.maps.estimate[index, agent], scales[1])
        error = float(np.sqrt(np.mean((run.maps.estimate[index, agent] - run.truth) ** 2)))
        bottom.set_title(f"estimate, RMS error {error:.2f}", fontsize=10.5)
        name_axes(top, left=place == 0, bottom=False)
        name_axes(bottom, left=place == 0, bottom=True)
    add_scale(figure, above, list(grid[0]), r"residual information $\gamma$")
    add_scale(figure, below, list(grid[1]), "estimate of x")
    figure.suptitle(title, fontweight="bold", fontsize=13.0)
    return figure


def _caption(run: SwarmRun, gamma: FloatArray, index: int) -> str:
    """Return the time and the part that is left; a small part is not rounded to zero."""
    most = float(gamma.max()) * gamma.shape[1]
    left = 100.0 * float(gamma[index].sum()) / most if most > 0.0 else 0.0
    part = f"{left:.1f}" if left >= 0.05 else "< 0.1" if left > 0.0 else "0"  # noqa: PLR2004 - what rounds to 0.1
    return f"t = {run.maps.time[index]:.1f} s: {part} % left"


def _field_scale(run: SwarmRun) -> Scale:
    """Return the scale that the field and all its estimates share."""
    return Scale(VALUE, float(run.truth.min()), float(run.truth.max()))
