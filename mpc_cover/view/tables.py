"""Tables for a terminal: a run's summary and the verifier's report."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from rich.text import Text

from mpc_cover.view.terminal_table import terminal_table

_PROMISED = 10.0
"""Per cent of the area that may be out of range though its cells are covered. A plain choice: box-3 misses 4."""

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rich.console import Console

    from mpc_cover.verification.report import Report
    from mpc_cover.verification.summary import RunSummary


def print_summary(summary: RunSummary, console: Console) -> None:
    """Print what was covered and when, and how near its limits the fleet came."""
    rows = [(Text(name, style="bold"), value) for name, value in _rows(summary)]
    console.print(terminal_table(f"{summary.mission} ({summary.kind})", (), rows, console.width, left=(0, 1)))
    for violation in summary.violations:
        console.print(Text(f"violation: {violation}", style="bold red"))


def print_report(report: Report, console: Console, information: dict[str, Any] | None = None) -> None:
    """Print what holds and by what margin, and the figures of the mission's kind of information, if it has some."""
    rows = [
        (
            check.name,
            Text("yes", style="green") if check.holds else Text("NO", style="bold red"),
            _margin(check.margin, check.unit),
            check.where,
        )
        for check in report.checks
    ]
    headers = ("check", "holds", "margin", "where it is smallest")
    console.print(terminal_table("verification", headers, rows, console.width, left=(0, 1, 3)))
    if information is not None:
        console.print(Text(_information(information), style=_warning(information)))
    failed = len(report.failures)
    if failed:
        console.print(Text(f"{failed} of {len(report.checks)} checks failed", style="bold red"))
    else:
        console.print(Text(f"all {len(report.checks)} checks hold", style="green"))


def print_area_seen(summary: RunSummary, console: Console) -> None:
    """Print how much area came within range."""
    if summary.area_seen_percent is not None:
        console.print(Text("area seen: ").append_text(_area_seen(summary)))


def _margin(margin: float, unit: str) -> str:
    """Return a signed margin; a violation's sign is never rounded away."""
    if margin in (float("inf"), float("-inf")):
        return "-"
    digits = f"{margin:+.4f}" if abs(margin) >= 1e-3 or margin == 0.0 else f"{margin:+.1e}"  # noqa: PLR2004 - taste
    return f"{digits} {unit}".rstrip()


def _information(figures: dict[str, Any]) -> str:
    """Return the figures of a mission's kind of information in a line, without those that do not exist."""
    shown = [_figure(name, value) for name, value in figures.items() if isinstance(value, float)]
    return f"{figures['kind']}: {', '.join(shown)}"


def _warning(figures: dict[str, Any]) -> str:
    """Return the style of the figures: a warning where a patrol exceeded its age limit."""
    worst = figures.get("worst_age_after_first_lap_s")
    return "bold red" if worst is not None and worst > figures["age_limit_s"] else ""


def _figure(name: str, value: float) -> str:
    """Return a figure with its name; names of seconds end in _s."""
    unit = " s" if name.endswith("_s") else ""
    return f"{name.removesuffix('_s').replace('_', ' ')} {value:.4g}{unit}"


def _rows(summary: RunSummary) -> Iterator[tuple[str, Text]]:
    covered = f"{summary.covered_percent:.2f} % ({summary.covered_cells} of {summary.cells} cells)"
    yield "covered", Text(covered, style="green" if summary.covered_cells == summary.cells else "")
    if summary.area_seen_percent is not None and summary.area_m2 is not None:
        yield "area seen", _area_seen(summary)
    times = (summary.time_to_90_s, summary.time_to_95_s, summary.time_to_99_s, summary.time_to_100_s)
    yield "time to 90 / 95 / 99 / 100 %", Text(" / ".join(_or(time, "{:.1f} s", "never") for time in times))
    if summary.information is not None:
        yield "information", Text(_information(summary.information), style=_warning(summary.information))
    if summary.swath_bound_s is not None:
        ratio = _or(summary.ratio_to_bound, "99 % after {:.2f} times that", "99 % never reached")
        rest = _or(summary.bound_from_rest_s, " ({:.1f} s from rest)", "")
        yield "swath bound", Text(f"{summary.swath_bound_s:.1f} s{rest}; {ratio}")
    if summary.smallest_separation_m is not None:
        asked = _or(summary.separation_min_m, "at least {:g} m asked for", "nothing asked for")
        yield "smallest separation", Text(f"{_down(summary.smallest_separation_m):.3f} m ({asked})")
    if summary.bottleneck_m is not None:
        yield "connected throughout", _connected(summary, summary.bottleneck_m)
    yield "largest speed", Text(f"{_up(summary.largest_speed_m_per_s):.3f} of {summary.speed_max_m_per_s:g} m/s")
    yield "largest input", Text(f"{_up(summary.largest_input_m_per_s2):.3f} of {summary.input_max_m_per_s2:g} m/s^2")
    each = ", ".join(f"{name} {metres:.1f}" for name, metres in summary.distance_m.items())
    yield "distance travelled", Text(f"{summary.distance_total_m:.1f} m ({each})")
    if summary.hovering_agent_s is not None:
        hovered = f"{summary.hovering_agent_s:.1f} s of all agents together, {summary.hovering_events} times"
        yield "hovered while owed", Text(hovered if summary.hovering_events else "never")
    yield "duration", Text(f"{summary.duration_s:.1f} s")
    if (steps := summary.step_times) is not None:
        taken = f"{steps.p50_ms:.1f} / {steps.p99_ms:.1f} / {steps.max_ms:.1f} ms of {steps.period_ms:g} ms"
        yield "step time p50 / p99 / max", Text(taken)
        missed = Text(f"{steps.misses} of {steps.steps}", style="bold red" if steps.misses else "")
        yield "periods missed", missed
    yield "verified", Text("yes", style="green") if summary.holds else Text("NO", style="bold red")


def _area_seen(summary: RunSummary) -> Text:
    """Return how much area came within range, as a warning where the cells promise more."""
    seen, promised = summary.area_seen_percent or 0.0, summary.covered_percent
    missing = promised - seen > _PROMISED
    text = f"{seen:.1f} % of {summary.area_m2:.4g} {summary.area_unit}"
    return Text(
        f"{text}: less than the cells say: make them smaller" if missing else text, "bold red" if missing else ""
    )


def _connected(summary: RunSummary, bottleneck: float) -> Text:
    edge = f"longest tree edge {_up(bottleneck):.3f} m"
    if summary.connected is None:
        return Text(f"not asked for ({edge})")
    detail = f" ({edge} of {summary.communication_range_m:g} m)"
    if summary.connected:
        return Text(f"yes{detail}")
    excuse = ", after a loss" if summary.holds else ""
    return Text(f"NO{detail}, apart for {summary.time_apart_s:.2f} s{excuse}", style="bold red")


def _or(value: float | None, form: str, otherwise: str) -> str:
    return otherwise if value is None else form.format(value)


def _down(value: float) -> float:
    """Round down to a thousandth, so that a distance too short never looks long enough; 1e-6 is forgiven."""
    return math.floor(1e3 * value + 1e-3) / 1e3


def _up(value: float) -> float:
    """Round up to a thousandth, so that what exceeds its bound never looks within it; 1e-6 is forgiven."""
    return math.ceil(1e3 * value - 1e-3) / 1e3
