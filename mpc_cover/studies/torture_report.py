"""What `mpc-cover torture` prints: a table by kind of fault, and each violation with the command that replays it."""

from __future__ import annotations

import shlex
from typing import TYPE_CHECKING

import numpy as np
from rich.text import Text

from mpc_cover.studies.torture import worst_ratio
from mpc_cover.studies.torture_runs import MIXED
from mpc_cover.view.terminal_table import terminal_table

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rich.console import Console

    from mpc_cover.service.torture.faults import FaultKind
    from mpc_cover.studies.torture import Replay, Torture
    from mpc_cover.studies.torture_runs import TortureRecord

SHOWN = 10
"""Violating flights that are listed; a plain choice."""
_COLUMNS = ["faults", "flights", "finished", "collided", "apart", "other", "smallest", "time, median", "worst"]


def print_torture(result: Torture, kinds: Sequence[FaultKind], command: Sequence[str], console: Console) -> None:
    """Print the table, and the worst flights with what replays each; `command` is that of one seed without it."""
    rows = [(kind, [record for record in result.records if record.kind == kind]) for kind in (*kinds, MIXED)]
    shown = [_row(str(kind), records, result) for kind, records in rows if records]
    if len(shown) > 1:
        shown.append(_row("all", result.records, result))
    asked = "flights by kind of fault; smallest distance [m]; time to cover over that without faults"
    console.print(terminal_table(asked, _COLUMNS, shown, console.width))
    if result.clean is not None and result.clean.covered_s is not None:
        console.print(
            f"without faults: {result.clean.covered_s:.1f} s, {result.clean.smallest_m:.3f} m", highlight=False
        )
    for record in result.violating[:SHOWN]:
        first = record.violations[0]
        again = shlex.join([*command, "--seed", str(record.seed)])
        console.print(f"{record.kind}: {first.line}\n  {again}", highlight=False, markup=False, soft_wrap=True)
    if (more := len(result.violating) - SHOWN) > 0:
        console.print(f"and {more} more", highlight=False)
    cpu_s = sum(record.cpu_s for record in result.records)
    many = len(result.violating)
    console.print(
        f"{len(result.records)} of {result.wanted} flights, {many} with a violation, {cpu_s:.0f} s of processor time",
        style="bold red" if many else "bold green",
        highlight=False,
    )


def _row(name: str, records: Sequence[TortureRecord], result: Torture) -> list[str | Text]:
    seen = [{violation.what for violation in record.violations} for record in records]
    collided = sum("separation" in what for what in seen)
    apart = sum("connectivity" in what for what in seen)
    other = sum(bool(what - {"separation", "connectivity"}) for what in seen)
    median, worst = worst_ratio(records, result.clean)
    counts = [Text(str(count), style="bold red" if count else "") for count in (collided, apart, other)]
    smallest = min(record.smallest_m for record in records)
    times = ["-" if np.isnan(ratio) else f"{ratio:.2f}" for ratio in (median, worst)]
    finished = sum(record.finished for record in records)
    return [name, str(len(records)), str(finished), *counts, f"{smallest:.3f}", *times]


def print_replay(replay: Replay, console: Console) -> None:
    """Print a seed's faults, what became of its flight, and the fewest faults that lead to its violations."""
    outcome = replay.outcome
    _say(console, f"faults ({replay.kind or 'none'}):")
    for fault in replay.faults:
        _say(console, f"  {fault.text}")
    _say(console, f"{outcome.text}; smallest distance {outcome.smallest_m:.3f} m; trace {outcome.digest[:16]}")
    for violation in outcome.violations:
        console.print(f"  {violation.line}", style="bold red", highlight=False, markup=False, soft_wrap=True)
    if outcome.violations and replay.fewest != replay.faults:
        _say(console, "the same kind of violation takes no more than:")
        for fault in replay.fewest:
            _say(console, f"  {fault.text}")


def _say(console: Console, text: str) -> None:
    console.print(text, highlight=False, markup=False, soft_wrap=True)
