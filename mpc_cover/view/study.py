"""Figures of a study: coverage over time, time to 99 % and step time by horizon, and the Pareto front of both."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.ticker import LogFormatter

from mpc_cover.view.style import INK, LIMIT, QUIET, agent_style, draw_limit, house_style, new_figure, outlined

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure

    from mpc_cover.arrays import FloatArray

    Draw = Callable[[Axes, Sequence["Series"]], None]

_MARKERS = "osD^vPX"
_INSTANTS = 400
"""At how many instants a band is drawn."""


@dataclass(frozen=True, eq=False)
class Series:
    """Runs of one controller at one horizon, over a mission.

    Attributes
    ----------
    label : its name.
    level : (L,) rising parts of the cells [%].
    curve : (R, L) [s] when each run reached each level; inf where never.
    time_99 : (R,) [s]; inf where never.
    step_ms : (S,) [ms] of all steps.
    period_ms : T_s [ms].
    bound_s : T_b [s]; None where the mission has none.
    """

    label: str
    level: FloatArray
    curve: FloatArray
    time_99: FloatArray
    step_ms: FloatArray
    period_ms: float
    bound_s: float | None

    def covered(self, time_s: FloatArray) -> FloatArray:
        """Return (R, T) [%]: what each run had covered at times (T,)."""
        reached = [np.searchsorted(curve, time_s, side="right") for curve in self.curve]
        return self.level[np.maximum(np.array(reached) - 1, 0)]


def study_figures(missions: Mapping[str, Sequence[Series]]) -> Iterator[tuple[str, Figure]]:
    """Yield each figure with its name: coverage by mission, then the comparisons of all missions."""
    with house_style():
        for mission, series in missions.items():
            yield f"coverage-{mission}", draw_coverage(mission, series)
        for name, draw in _COMPARISONS.items():
            yield name, _by_mission(missions, draw)


def draw_coverage(mission: str, series: Sequence[Series]) -> Figure:
    """Draw a panel for each series: the median and the band of 10 to 90 % of the runs, the others' medians in grey."""
    columns = 2 if len(series) == 4 else min(3, len(series))  # noqa: PLR2004 - two by two
    rows = -(-len(series) // columns)
    figure = new_figure(max(6.0, 4.3 * columns), 3.3 * rows + 0.5)
    grid = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False).ravel()
    time = np.linspace(0.0, _last_time(series), _INSTANTS)
    covered = [one.covered(time) for one in series]
    for index, (axes, one) in enumerate(zip(grid, series, strict=False)):
        colour = agent_style(index)[0]
        for other in covered:
            axes.plot(time, np.median(other, axis=0), color="#c9c9c9", linewidth=1.0)
        low, middle, high = np.percentile(covered[index], (10, 50, 90), axis=0)
        axes.fill_between(time, low, high, color=colour, alpha=0.25, linewidth=0)
        axes.plot(time, middle, color=colour, linewidth=2.2)
        _draw_bound(axes, one)
        axes.set_title(one.label)
        _note(axes, f"99 %: median {_time(_median(one.time_99))}\nworst {_time(one.time_99.max())}\n{_runs(one)}")
    for axes in grid[len(series) - columns : len(series)]:
        axes.tick_params(labelbottom=True)  # there is no panel below
    for axes in grid[len(series) :]:
        axes.remove()
    grid[0].set(ylim=(0.0, 103.0), xlim=(0.0, time[-1]))
    figure.supxlabel("time [s]", fontsize=10.5)
    figure.supylabel("covered [%]", fontsize=10.5)
    figure.suptitle(f"{mission}: coverage over time", fontsize=13.0, fontweight="bold")
    return figure


def draw_times(axes: Axes, series: Sequence[Series]) -> None:
    """Draw the times to 99 % as boxes with a point per run; the number of runs that never got there is above."""
    reached = [one.time_99[np.isfinite(one.time_99)] for one in series]
    place = np.arange(len(series))
    boxes = axes.boxplot(reached, positions=place, widths=0.55, showfliers=False, patch_artist=True)
    for index, (box, times) in enumerate(zip(boxes["boxes"], reached, strict=True)):
        colour = agent_style(index)[0]
        box.set(facecolor=colour, alpha=0.35, edgecolor=INK)
        boxes["medians"][index].set(color=INK, linewidth=2.0)
        side = 0.18 * np.sin(7.0 * np.arange(len(times)))  # spread, the same each time
        axes.plot(place[index] + side, times, "o", color=colour, markersize=3.5, markeredgewidth=0, alpha=0.9)
        if never := len(series[index].time_99) - len(times):
            text = f"{never} of {len(series[index].time_99)}\nnever"
            style: Any = {"color": LIMIT, "fontsize": 9.0, "path_effects": outlined(2.5)}
            axes.text(place[index], 0.99, text, transform=axes.get_xaxis_transform(), ha="center", va="top", **style)
    _set_times(axes, series[0].bound_s, np.concatenate(reached))
    _name_places(axes, series)
    axes.set_ylabel("time to 99 % [s]")


def draw_step_times(axes: Axes, series: Sequence[Series]) -> None:
    """Draw the middle half and the 99th percentile of the step times, and the longest, with the period."""
    for index, one in enumerate(series):
        if not one.step_ms.size:
            continue
        colour = agent_style(index)[0]
        low, middle, high, p99 = np.percentile(one.step_ms, (25, 50, 75, 99))
        axes.plot([index, index], [low, p99], color=colour, linewidth=1.6)
        axes.plot([index, index], [low, high], color=colour, linewidth=9.0, alpha=0.5, solid_capstyle="butt")
        axes.plot(index, middle, "_", color=INK, markersize=13, markeredgewidth=2.0)
        axes.plot(index, p99, "D", color=colour, markersize=5.5)
        axes.plot(index, one.step_ms.max(), "x", color=colour, markersize=6)
        axes.annotate(f"{p99:.0f}", (index, p99), xytext=(6, 0), textcoords="offset points", va="center", fontsize=9)
    for period in sorted({one.period_ms for one in series}):
        draw_limit(axes, period, f"period {period:g} ms", above=False)
    axes.set_yscale("log")
    _plain_numbers(axes.yaxis)
    _name_places(axes, series)
    axes.set_ylabel("step time [ms]: quartiles, ◆ p99, x longest", fontsize=9.5)


def draw_front(axes: Axes, series: Sequence[Series]) -> None:
    """Draw the Pareto front of the median time to 99 % and the 99th percentile of the step time."""
    points = []
    for index, one in enumerate(series):
        time = _median(one.time_99)
        if not one.step_ms.size or not math.isfinite(time):
            continue
        points.append((float(np.percentile(one.step_ms, 99)), time))
        colour, marker = agent_style(index)[0], _MARKERS[index % len(_MARKERS)]
        style: Any = {"color": colour, "markersize": 9, "markeredgecolor": "white", "zorder": 4}
        axes.plot(*points[-1], marker, linestyle="none", label=one.label, **style)
    if points:
        axes.step(*np.array(pareto_front(points)).T, where="post", color=QUIET, linewidth=1.4, linestyle=(0, (6, 2)))
        axes.legend(loc="best")
    _set_times(axes, series[0].bound_s, np.array([time for _, time in points]))
    axes.margins(x=0.25)
    axes.set_xscale("log")
    _plain_numbers(axes.xaxis)
    axes.set_xlabel("step time p99 [ms]")
    axes.set_ylabel("median time to 99 % [s]")


def pareto_front(points: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """Return the points that no other is at most equal to in both coordinates, by the first."""
    front: list[tuple[float, float]] = []
    for point in sorted(points):
        if not front or point[1] < front[-1][1]:
            front.append(point)
    return front


_COMPARISONS: dict[str, Draw] = {"time-to-99": draw_times, "step-time": draw_step_times, "pareto": draw_front}


def _by_mission(missions: Mapping[str, Sequence[Series]], draw: Draw) -> Figure:
    """Return a figure with a panel for each mission."""
    columns = min(2, len(missions))
    rows = -(-len(missions) // columns)
    most = max(len(series) for series in missions.values())
    figure = new_figure(max(6.5, 0.9 * most + 1.5) * columns, 4.3 * rows)
    grid = figure.subplots(rows, columns, squeeze=False).ravel()
    for axes, (mission, series) in zip(grid, missions.items(), strict=False):
        draw(axes, series)
        axes.set_title(mission)
    for axes in grid[len(missions) :]:
        axes.remove()
    return figure


def _last_time(series: Sequence[Series]) -> float:
    """Return when the slowest of the medians reached its last level, and a little more [s]."""
    middle = np.array([np.median(one.curve, axis=0) for one in series])
    return 1.08 * float(middle[np.isfinite(middle)].max(initial=1.0))


def _set_times(axes: Axes, bound_s: float | None, times: FloatArray) -> None:
    """Let the times [s] fit on the y axis, from 0, and the swath bound with them."""
    highest = max(float(times.max(initial=0.0)), bound_s or 1.0)
    axes.set_ylim(0.0, 1.2 * highest)
    if bound_s is not None:
        draw_limit(axes, bound_s, f"swath bound {bound_s:.1f} s", QUIET)


def _draw_bound(axes: Axes, one: Series) -> None:
    if one.bound_s is not None:
        axes.axvline(one.bound_s, color=QUIET, linewidth=1.2, linestyle=(0, (6, 2)))


def _note(axes: Axes, text: str) -> None:
    box = {"facecolor": "white", "alpha": 0.85, "edgecolor": "none", "pad": 3.0}
    axes.text(0.98, 0.05, text, transform=axes.transAxes, ha="right", va="bottom", fontsize=9.5, bbox=box)


def _name_places(axes: Axes, series: Sequence[Series]) -> None:
    axes.set_xticks(range(len(series)), [one.label.replace(" ", "\n", 1) for one in series])
    axes.set_xlim(-0.6, len(series) - 0.4)
    axes.grid(visible=False, axis="x")


def _plain_numbers(axis: Axis) -> None:
    """Write 10 and 100 on a logarithmic axis, and something between where there is room."""
    axis.set_major_formatter(LogFormatter())
    axis.set_minor_formatter(LogFormatter(minor_thresholds=(2.0, 0.5)))


def _median(values: FloatArray) -> float:
    return float(np.median(values))


def _time(value: float) -> str:
    return f"{value:.1f} s" if math.isfinite(value) else "never"


def _runs(one: Series) -> str:
    return f"{len(one.curve)} run{'s' if len(one.curve) != 1 else ''}"
