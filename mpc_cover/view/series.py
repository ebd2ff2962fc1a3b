"""Panels over time: coverage, speeds, inputs, distances between agents, step times."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from mpc_cover.verification.area_bound import swath_bound
from mpc_cover.verification.connectivity import bottleneck
from mpc_cover.verification.losses import losses_of
from mpc_cover.verification.path import Path
from mpc_cover.verification.summary import floor_percent, look_interval, time_to_cover
from mpc_cover.view.style import GOOD, INK, LIMIT, QUIET, agent_style, draw_limit, outlined

if TYPE_CHECKING:
    from collections.abc import Iterator

    from matplotlib.axes import Axes

    from mpc_cover.arrays import FloatArray
    from mpc_cover.trajectory_file import Recording

_FEW = 6
"""Up to so many agents a curve each is legible; above, the largest of all is drawn on top."""
_ROOM = 1.3
"""Height of the distances' axes over the largest value, for a legend above the curves."""
_DENSE = 4000
"""About how many instants a curve of distances is evaluated at."""


def draw_coverage(axes: Axes, trajectory: Recording) -> None:
    """Draw the covered part of the cells over time, and when it passed 90, 95 and 99 %."""
    covered = np.sort(trajectory.covered_at[np.isfinite(trajectory.covered_at)])
    cells, end = trajectory.covered_at.size, trajectory.time[-1]
    moments = np.concatenate([trajectory.time[:1], covered, [end]])
    part = 100.0 * np.concatenate([[0], np.arange(1, covered.size + 1), [covered.size]]) / cells
    axes.fill_between(moments, part, step="post", color=GOOD, alpha=0.15, linewidth=0)
    axes.step(moments, part, where="post", color=GOOD, linewidth=2.2)
    lines = []
    for level in (90, 95, 99):
        axes.axhline(level, color=QUIET, linewidth=0.9, linestyle=":")
        time = time_to_cover(trajectory, level)
        lines.append(f"{level} %: " + ("never" if time is None else f"{time:.1f} s"))
        if time is not None:
            axes.plot(time, level, "o", color=GOOD, markeredgecolor="white", markersize=6, zorder=4)
    if (bound := swath_bound(trajectory.mission, look_interval(trajectory))) is not None and bound <= end:
        axes.axvline(bound, color=QUIET, linewidth=1.2, linestyle=(0, (6, 2)))
        lines.append(f"swath bound (dashed): {bound:.1f} s")
    box = {"facecolor": "white", "alpha": 0.85, "edgecolor": "none", "pad": 3.0}
    height, side = (0.06, "bottom") if 2 * covered.size > cells else (0.86, "top")
    axes.text(0.985, height, "\n".join(lines), transform=axes.transAxes, ha="right", va=side, bbox=box, fontsize=9.5)
    axes.set_ylim(0.0, 103.0)
    _finish(axes, trajectory, f"Covered: {floor_percent(covered.size, cells):g} % of {cells} cells", "covered [%]")


def draw_speeds(axes: Axes, trajectory: Recording) -> None:
    """Draw each agent's speed with its bound (3.12)."""
    speed = np.linalg.norm(trajectory.velocity, axis=2)
    for agent, style in enumerate(_agent_lines(trajectory)):
        axes.plot(trajectory.time, speed[:, agent], **style)
    if len(trajectory.agent_id) > _FEW:
        axes.plot(trajectory.time, speed.max(axis=1), color=INK, linewidth=2.0, label="largest")
    _draw_bounds(axes, trajectory.mission.fleet.speed_max, speed, r"$v_\mathrm{max}$", "m/s")
    _finish(axes, trajectory, "Speeds", "speed [m/s]")


def draw_inputs(axes: Axes, trajectory: Recording) -> None:
    """Draw the norm of each agent's input, held over each interval, with its bound (3.11)."""
    norm = np.linalg.norm(trajectory.input, axis=2)
    for agent, style in enumerate(_agent_lines(trajectory)):
        axes.stairs(norm[:, agent], trajectory.time, baseline=None, **style)
    if len(trajectory.agent_id) > _FEW:
        axes.stairs(norm.max(axis=1), trajectory.time, baseline=None, color=INK, linewidth=2.0, label="largest")
    _draw_bounds(axes, trajectory.mission.fleet.input_max, norm, r"$u_\mathrm{max}$", "m/s²")
    _finish(axes, trajectory, "Inputs", "input [m/s²]")


def draw_distances(axes: Axes, trajectory: Recording) -> None:
    """Draw the distance of each pair, also between samples, with rho_B, rho_C and the longest edge of the tree.

    The tree is that of the agents that are not lost (4.20); lost ones remain obstacles, from which others keep apart.
    """
    fleet = trajectory.mission.fleet
    path = Path(trajectory.time, trajectory.position, trajectory.velocity, trajectory.input)
    time, position = path.dense(max(1, _DENSE // len(trajectory.time)))
    first, second = path.pair
    losses = losses_of(trajectory)
    distance = np.linalg.norm(position[:, first] - position[:, second], axis=2)
    axes.plot(time, distance, color=QUIET, linewidth=0.9, alpha=max(0.25, 1.0 - 0.02 * first.size))
    if len(trajectory.agent_id) > 2:  # noqa: PLR2004 - of one pair the tree is the pair
        widest, name = _longest_edge(losses, len(trajectory.agent_id), time, distance), "longest tree edge"
        name = "tree edge (living)" if losses else name
        axes.plot(time, widest, color=INK, linewidth=2.6, label=name, path_effects=outlined(4.0))
        axes.plot(time, distance.min(axis=1), color="#D55E00", linewidth=2.2, label="closest pair")
    _mark_losses(axes, trajectory, losses)
    if axes.get_legend_handles_labels()[1]:
        legend = axes.legend(loc="upper left", ncols=2, handlelength=1.3, columnspacing=0.9, borderpad=0.2)
        legend.set_in_layout(False)
    top = _ROOM * float(distance.max())
    if fleet.separation_min > 0.0:
        axes.axhspan(0.0, fleet.separation_min, color=LIMIT, alpha=0.12, linewidth=0)
        draw_limit(axes, fleet.separation_min, rf"separation $\rho_B$ = {fleet.separation_min:g} m")
    if np.isfinite(fleet.communication_range):
        reach = rf"communication range $\rho_C$ = {fleet.communication_range:g} m"
        draw_limit(axes, fleet.communication_range, reach)
        top = max(top, _ROOM * fleet.communication_range)
    axes.set_ylim(0.0, top)
    _finish(axes, trajectory, "Distances between agents", "distance [m]")


def _longest_edge(losses: dict[int, float], agents: int, time: FloatArray, distance: FloatArray) -> FloatArray:
    """Return (Q,) the longest edge [m] of the tree of agents not lost at times (Q,) [s]; NaN where one is left.

    `losses` are the times of losses [s] by agent; `distance` is (Q, P) [m].
    """
    first, second = np.triu_indices(agents, k=1)
    widest = np.full(time.shape, np.nan)
    since = np.sort([-np.inf, *losses.values()])
    for begin, end in pairwise([*since, np.inf]):
        active = [i for i in range(agents) if losses.get(i, np.inf) > begin]
        now, between = (time >= begin) & (time < end), np.isin(first, active) & np.isin(second, active)
        if between.any() and now.any():
            widest[now] = bottleneck(distance[np.ix_(now, between)], len(active))
    return widest


def _mark_losses(axes: Axes, trajectory: Recording, losses: dict[int, float]) -> None:
    """Draw when agents were lost, each named along its line, where it hides no curve."""
    for index, time in sorted(losses.items(), key=lambda item: item[1]):
        colour = agent_style(index)[0]
        axes.axvline(time, color=colour, linewidth=1.8, linestyle=(0, (2, 1.5)), zorder=3)
        axes.annotate(
            f"{trajectory.agent_id[index]} lost",
            (time, 0.78),
            xycoords=axes.get_xaxis_transform(),
            xytext=(-2, 0),
            textcoords="offset points",
            rotation=90,
            ha="right",
            va="top",
            fontsize=9.0,
            color=colour,
            path_effects=outlined(2.5),
        )


def draw_altitudes(axes: Axes, trajectory: Recording) -> None:
    """Draw each agent's altitude, also between samples, with the bounds of the box that agents stay in (3.13, 3.14)."""
    path = Path(trajectory.time, trajectory.position, trajectory.velocity, trajectory.input)
    time, position = path.dense(max(1, _DENSE // len(trajectory.time)))
    for agent, style in enumerate(_agent_lines(trajectory)):
        axes.plot(time, position[:, agent, 2], **style)
    low, high = (
        float(bound[2]) for bound in (trajectory.mission.fleet.motion_min, trajectory.mission.fleet.motion_max)
    )
    draw_limit(axes, high, f"highest {high:g} m")
    draw_limit(axes, low, f"lowest {low:g} m", above=False)
    room = 0.12 * (high - low)
    axes.set_ylim(min(low, float(position[..., 2].min())) - room, max(high, float(position[..., 2].max())) + room)
    _finish(axes, trajectory, "Altitudes", "z [m]")


def draw_step_times(axes: Axes, step_times: FloatArray, period_s: float) -> None:
    """Draw the duration of each step (S,) [s] of the controller, with the period."""
    taken, period = 1e3 * step_times, 1e3 * period_s
    number = np.arange(1, taken.size + 1)
    missed = taken > period
    axes.bar(number[~missed], taken[~missed], width=0.85, color="#0072B2", linewidth=0)
    axes.bar(number[missed], taken[missed], width=0.85, color=LIMIT, linewidth=0)
    draw_limit(axes, period, f"period {period:g} ms", above=False)
    p50, p99 = np.percentile(taken, (50, 99))
    text = f"p50 {p50:.0f}, p99 {p99:.0f}, max {taken.max():.0f} ms"
    axes.text(
        0.015, 0.985, text, transform=axes.transAxes, ha="left", va="top", fontsize=9.5, path_effects=outlined(2.5)
    )
    axes.set_title(f"Step times: {int(missed.sum())} of {taken.size} late")
    axes.set_ylim(0.0, 1.3 * max(period, float(taken.max())))
    axes.set_xlim(0.0, taken.size + 1.0)
    axes.set_xlabel("step of the controller")
    axes.set_ylabel("time taken [ms]")


def _draw_bounds(axes: Axes, bound: FloatArray, value: FloatArray, name: str, unit: str) -> None:
    """Draw the (m,) bounds, one line for all agents that share it, and room above the (n, m) values."""
    for limit in np.unique(bound):
        draw_limit(axes, float(limit), f"{name} = {limit:g} {unit}")
    axes.set_ylim(0.0, 1.2 * max(float(bound.max()), float(value.max())))


def _agent_lines(trajectory: Recording) -> Iterator[dict[str, Any]]:
    """Yield how each agent's curve is drawn: earlier ones wider, to show behind later ones; thin where many."""
    agents = len(trajectory.agent_id)
    for agent, name in enumerate(trajectory.agent_id):
        colour, line = agent_style(agent)
        width = 1.4 + 0.7 * min(agents - 1 - agent, 3) if agents <= _FEW else 0.8
        alpha = 1.0 if agents <= _FEW else 0.6
        yield {"color": colour, "linestyle": line, "linewidth": width, "alpha": alpha, "label": name}


def _finish(axes: Axes, trajectory: Recording, title: str, label: str) -> None:
    axes.set_title(title)
    axes.set_xlabel("time [s]")
    axes.set_ylabel(label)
    axes.set_xlim(float(trajectory.time[0]), float(trajectory.time[-1]))
