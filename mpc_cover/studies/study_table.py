"""The table of a study: a row for each group of runs."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from rich.text import Text

from mpc_cover.studies.tally import median, worst
from mpc_cover.verification.tolerance import TOLERANCE
from mpc_cover.view.terminal_table import terminal_table

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from rich.console import Console

    from mpc_cover.studies.tally import Group

HEADERS = (
    "controller",
    "runs",
    "done\n[%]",
    "99 % [s]\nmed / worst",
    "over bound\nmed / worst",
    "margin\n[m]",
    "viol.\nin runs",
    "step p99\n[ms]",
)
"""Of the table: runs that covered everything, time to 99 % of the cells, the same over the swath bound, smallest
separation less rho_B, violations in how many runs, 99th percentile of all step times and how many are late."""


def print_groups(groups: Mapping[str, Sequence[Group]], console: Console) -> None:
    """Print a table for each mission."""
    for mission, some in groups.items():
        rows = [[Text(text, style="bold red" if bad else "") for text, bad in row_of(group)] for group in some]
        console.print(terminal_table(title_of(mission, some), HEADERS, rows, console.width))


def title_of(mission: str, groups: Sequence[Group]) -> str:
    """Return a mission's name with its swath bound, if it has one."""
    bound = bound_of(groups[0])
    return mission if bound is None else f"{mission}: swath bound {bound:.1f} s"


def bound_of(group: Group) -> float | None:
    """Return T_b [s], or None where it is not defined."""
    return next((record.swath_bound_s for record in group.records if record.swath_bound_s is not None), None)


def row_of(group: Group) -> list[tuple[str, bool]]:
    """Return a group's row of the table: for each of `HEADERS` a text, and whether it shows a problem."""
    runs, margin, late = len(group.records), group.margin_m, group.misses
    time = median(group.time_99_s), worst(group.time_99_s)
    ratio = median(group.ratio_99), worst(group.ratio_99)
    never = math.isinf(time[1])
    return [
        (group.label, False),
        (f"{runs}, {group.errors} broke off" if group.errors else f"{runs}", group.errors > 0),
        (f"{group.complete_percent:g}", not all(record.complete for record in group.records)),
        (" / ".join(_or_never(value, "{:.1f}") for value in time), never),
        (" / ".join(_or_never(value, "{:.2f}") for value in ratio) if group.ratio_99.size else "-", never),
        ("-" if math.isinf(margin) else f"{math.floor(1e3 * margin + 1e-3) / 1e3:+.3f}", margin < -TOLERANCE),
        (f"{group.violations} in {group.violators}" if group.violations else "0", group.violations > 0),
        (_or_never(group.step_p99_ms, "{:.1f}") + (f", {late} late" if late else ""), late > 0),
    ]


def _or_never(value: float, form: str) -> str:
    if math.isnan(value):
        return "-"
    return form.format(value) if math.isfinite(value) else "never"
