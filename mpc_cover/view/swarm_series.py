"""Panels over time of a swarm: residual information, each agent's knowledge of it, and distances between agents."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.verification.connectivity import bottleneck
from mpc_cover.view.style import GOOD, INK, LIMIT, QUIET, draw_limit, outlined

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from mpc_cover.view.swarm_run import SwarmRun

_DENSE = 3000
"""About how many instants distances are evaluated at."""
_GLOBAL = "#D55E00"


def draw_left(axes: Axes, run: SwarmRun) -> None:
    """Draw the residual information of all cells as a percentage, and when 5, 1 and 0 % were left."""
    time, left = run.path.time, 100.0 * run.residual
    axes.fill_between(time, left, color=GOOD, alpha=0.15, linewidth=0)
    axes.plot(time, left, color=GOOD, linewidth=2.2)
    lines = []
    for level in (5.0, 1.0, 0.0):
        below = left <= level
        moment = float(time[int(np.argmax(below))]) if below.any() else None
        lines.append(f"{level:g} % left: " + ("never" if moment is None else f"{moment:.1f} s"))
        if moment is not None:
            axes.plot(moment, level, "o", color=GOOD, markeredgecolor="white", markersize=7, zorder=4, clip_on=False)
    axes.text(0.98, 0.95, "\n".join(lines), transform=axes.transAxes, ha="right", va="top", fontsize=9.5)
    _finish(axes, run, "Residual information", "left [%]", top=103.0)


def draw_known(axes: Axes, run: SwarmRun, global_run: SwarmRun, watched: int) -> None:
    """Draw the residual information by an agent's knowledge, the true one, and that with global knowledge (6.3)."""
    time = run.path.time
    name = run.fleet.ids[watched]
    axes.plot(
        time, 100.0 * run.own_residual[:, watched], color=GOOD, linewidth=2.4, label=f"{name}'s estimate, delayed"
    )
    axes.plot(time, 100.0 * run.residual, color=INK, linewidth=1.3, label="what is left")
    label = "with global knowledge"
    axes.plot(global_run.path.time, 100.0 * global_run.residual, color=_GLOBAL, linestyle=(0, (5, 2)), label=label)
    for each, colour, height in ((run, INK, 14.0), (global_run, _GLOBAL, 26.0)):
        done = each.residual <= 0.0
        if done.any():
            moment = float(each.path.time[int(np.argmax(done))])
            axes.plot(moment, 0.0, "o", color=colour, markeredgecolor="white", markersize=7, zorder=5, clip_on=False)
            axes.annotate(
                f"all covered: {moment:.1f} s",
                (moment, 0.0),
                xytext=(0, height),
                textcoords="offset points",
                color=colour,
                ha="right",
                fontsize=9.0,
                path_effects=outlined(2.5),
            )
    axes.legend(loc="upper right")
    _finish(axes, run, "Residual information", "left [%]", top=103.0)


def draw_distances(axes: Axes, run: SwarmRun) -> None:
    """Draw the distance of each pair along the continuous path, with rho_B, rho_C and the tree's longest edge."""
    fleet, path = run.fleet, run.path
    time, position = path.dense(max(1, _DENSE // len(path.time)))
    first, second = path.pair
    distance = np.linalg.norm(position[:, first] - position[:, second], axis=2)
    axes.plot(time, distance, color=QUIET, linewidth=0.8, alpha=max(0.2, 1.0 - 0.03 * first.size))
    widest = bottleneck(distance, fleet.size)
    axes.plot(time, widest, color=INK, linewidth=2.0, label="longest tree edge", path_effects=outlined(3.4))
    axes.plot(
        time, distance.min(axis=1), color=_GLOBAL, linewidth=2.0, label="closest pair", path_effects=outlined(3.4)
    )
    axes.axhspan(0.0, fleet.separation_min, color=LIMIT, alpha=0.12, linewidth=0)
    draw_limit(axes, fleet.separation_min, rf"$\rho_B$ = {fleet.separation_min:g} m", above=False)
    top = 1.22 * float(distance.max())
    if np.isfinite(fleet.communication_range):
        draw_limit(axes, fleet.communication_range, rf"$\rho_C$ = {fleet.communication_range:g} m")
        top = max(top, 1.22 * fleet.communication_range)
    axes.legend(loc="upper left", ncols=2)
    _finish(axes, run, "Distances between agents", "distance [m]", top=top)


def _finish(axes: Axes, run: SwarmRun, title: str, label: str, top: float) -> None:
    axes.set_title(title)
    axes.set_xlabel("time [s]")
    axes.set_ylabel(label)
    axes.set_xlim(0.0, float(run.path.time[-1]))
    axes.set_ylim(0.0, top)
