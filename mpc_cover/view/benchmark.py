"""Tables of benchmarks, and the figure of J over time for each planner."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

from rich.text import Text

from mpc_cover.view.terminal_table import terminal_table

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from rich.console import Console


@dataclass(frozen=True)
class Row:
    """One peer's line; None where there is nothing to show.

    Attributes
    ----------
    setup_s, time_s : before solving, and solving until it stopped or was stopped.
    ratio : of `time_s` to ours.
    cost_m, covered_percent : J (4.34) exactly of the best iterate that holds at the samples, and what it covers.
    best_at_s : when that iterate was there.
    flyable_cost_m : the least J of an iterate that holds along the continuous path, too.
    violation_sampled, violation_path : the worst of that iterate (else of the least violated one).
    separation_sampled_m, separation_path_m : its smallest distance less rho_B; negative when too close.
    worst : what it violates most along the path; holds : nothing.
    """

    name: str
    setup_s: float | None
    time_s: float | None
    ratio: float | None
    cost_m: float | None
    covered_percent: float | None
    best_at_s: float | None
    flyable_cost_m: float | None
    violation_sampled: float | None
    violation_path: float | None
    separation_sampled_m: float | None
    separation_path_m: float | None
    iterations: int | None
    status: str
    worst: str
    holds: bool

    def to_dict(self) -> dict[str, Any]:
        """Return the row as plain data; what is not finite becomes None, as JSON has no inf."""
        return {
            name: None if isinstance(value, float) and not math.isfinite(value) else value
            for name, value in asdict(self).items()
        }


@dataclass(frozen=True)
class Curve:
    """The least J [m] that a peer had by when [s]; `end_s` is when it stopped."""

    name: str
    time_s: list[float]
    cost_m: list[float]
    end_s: float


def print_benchmark(rows: Sequence[Row], title: str, console: Console) -> None:
    """Print a line for each peer, and below the table why each ended and what its best motion violates.

    A table of 80 columns; what else a row holds is in bench.csv.
    """
    headers = ["peer", *(f"{header}\n{unit}" for header, unit in _HEADERS)]
    console.print(terminal_table(title, headers, [_cells(row) for row in rows], console.width))
    for names, status, worst in _endings(rows):
        line = Text(f"{', '.join(names)}: {status}")
        if worst:
            line.append(f"; violates {worst}", style="red")
        console.print(line)


_HEADERS = (
    ("time", "[s]"),
    ("time", "/ ours"),
    ("J", "[m]"),
    ("covered", "[%]"),
    ("best at", "[s]"),
    ("J flown", "[m]"),
    ("worst", "breach"),
    ("iter-", "ations"),
)


def _endings(rows: Sequence[Row]) -> list[tuple[list[str], str, str]]:
    """Return why peers ended and what they violate, those that ended alike together: names, status, violation."""
    names: dict[tuple[str, str], list[str]] = {}
    for row in rows:
        names.setdefault((row.status, row.worst), []).append(row.name)
    return [(alike, status, worst) for (status, worst), alike in names.items()]


def _cells(row: Row) -> list[str | Text]:
    violation = _number(row.violation_path, "{:.1g}") if row.violation_path else "0"
    return [
        row.name,
        _number(row.time_s, "{:.2f}"),
        _number(row.ratio, "{:.1f}"),
        _number(row.cost_m, "{:.4f}"),
        _number(row.covered_percent, "{:.2f}"),
        _number(row.best_at_s, "{:.2f}"),
        _number(row.flyable_cost_m, "{:.4f}"),
        Text(violation if row.time_s is not None else "-", style="" if row.holds else "bold red"),
        _number(row.iterations, "{:d}"),
    ]


def print_steps(parts: dict[str, tuple[float, float, float]], title: str, console: Console) -> None:
    """Print where a control step's time goes: median, 99th percentile [ms] and share of each part."""
    rows = [
        (name, f"{median:.2f} ms", f"{high:.2f} ms", f"{100.0 * share:.1f} %")
        for name, (median, high, share) in parts.items()
    ]
    console.print(terminal_table(title, ("part", "median", "p99", "share"), rows, console.width))


def print_maps(rows: Sequence[dict[str, str | float]], title: str, console: Console) -> None:
    """Print how long a step of each map takes [ms]."""
    shown = [
        (str(row["map"]), str(row["cells_in_range"]), *(f"{row[name]:.2f} ms" for name in ("p50_ms", "p99_ms")))
        for row in rows
    ]
    console.print(terminal_table(title, ("map", "cells in a disc", "median", "p99"), shown, console.width))


def draw_history(curves: Sequence[Curve], title: str, file: Path) -> Path:
    """Draw J over time, both logarithmic, and write it as PNG; what has reached 0 lies on the bottom line."""
    from mpc_cover.view.style import agent_style, house_style, new_figure, save_figure  # noqa: PLC0415 - matplotlib

    costs = [cost for curve in curves for cost in curve.cost_m if cost > 0.0]
    floor = 0.3 * min(costs, default=1e-3)
    with house_style():
        figure = new_figure(8.6, 5.2)
        axes = figure.add_subplot()
        for index, curve in enumerate(curves):
            colour, line = agent_style(index)
            shown = [max(time, _FIRST_S) for time in curve.time_s]
            heights = [max(cost, floor) for cost in curve.cost_m]
            end = max(curve.end_s, shown[-1])
            label = f"{curve.name}: {curve.cost_m[-1]:.3g} m"
            axes.step([*shown, end], [*heights, heights[-1]], where="post", color=colour, linestyle=line, label=label)
            axes.plot(end, heights[-1], "o", color=colour, markersize=5)
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.axhline(floor, color="#767676", linewidth=0.9, linestyle=":")
        axes.annotate("J = 0", (0.0, floor), xycoords=("axes fraction", "data"), xytext=(3, 3), **_OFFSET)
        axes.set_title(title)
        axes.set_xlabel("time [s]")
        axes.set_ylabel("least J so far [m]")
        if curves:
            figure.legend(loc="outside right upper", fontsize=9.5, handlelength=2.6)
        return save_figure(figure, file)


_FIRST_S = 0.01
"""Where the axis of time begins; the guess is there at once."""
_OFFSET: dict[str, Any] = {"textcoords": "offset points", "fontsize": 9.0, "color": "#767676"}


_WIDEST = 7
"""Characters of a number in a table: eight columns of them, and the names of peers, fit into 80."""


def _number(value: float | None, form: str) -> str:
    """Return a number in a form, with fewer digits where it would be wider than its column."""
    if value is None or not math.isfinite(value):
        return "-"
    text = form.format(value)
    return text if len(text) <= _WIDEST else f"{value:.2g}"
