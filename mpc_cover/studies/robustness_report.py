"""The report of the robustness study: a table of the worst ratios, a picture of it, and a page with the worst cases."""

from __future__ import annotations

import base64
import math
from html import escape
from typing import TYPE_CHECKING

from rich.text import Text

from mpc_cover.studies.page import document, made_by
from mpc_cover.view.terminal_table import terminal_table

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    from rich.console import Console

    from mpc_cover.studies.results import StudyFolder
    from mpc_cover.studies.robustness_result import RobustnessResult

_SHOWN = 20
"""Worst cases on the page; a plain choice."""


def tables_of(results: Sequence[RobustnessResult]) -> dict[str, dict[tuple[str, str], list[RobustnessResult]]]:
    """Return the results by table, then by row and column, in the order of the cases."""
    found: dict[str, dict[tuple[str, str], list[RobustnessResult]]] = {}
    for result in results:
        case = result.case
        found.setdefault(case.table, {}).setdefault((case.shape, case.change), []).append(result)
    return found


def print_tables(results: Sequence[RobustnessResult], console: Console) -> None:
    """Print a table of worst ratios for shapes, and one for crowds; what does not pass is red."""
    for title, cells in tables_of(results).items():
        rows, columns = _axes(cells)
        heading = f"{title}: worst time to 99 % over the bound of the shape (flights that are not finished)"
        shown: list[list[str | Text]] = []
        for row in rows:
            flights = [cells.get((row, column), []) for column in columns]
            shown.append([row, *(Text(cell_text(some), style=_style(some)) for some in flights)])
        console.print(terminal_table(heading, ["shape", *columns], shown, console.width))
    console.print(_verdict(results))
    for result in _worst(results, limit=5):
        console.print(f"  {line_of(result)}", highlight=False, markup=False, soft_wrap=True)


def cell_text(cell: Sequence[RobustnessResult]) -> str:
    """Return the worst ratio of a cell, and in brackets how many of its flights are not finished."""
    if not cell:
        return ""
    worst = _worst_ratio(cell)
    text = "-" if math.isnan(worst) else "never" if math.isinf(worst) else f"{worst:.2f}"
    unfinished = sum(not result.finished for result in cell if result.record is not None)
    return f"{text} ({unfinished})" if unfinished else text


def line_of(result: RobustnessResult) -> str:
    """Return a case with its figures in a line."""
    record, case = result.record, result.case
    name = " ".join(part for part in (case.shape, case.change, case.value) if part)
    if record is None:
        return f"{name}: not flown"
    if record.error:
        return f"{name}: broke off: {record.error}"
    reached = [f"{time:.1f} s" if time is not None else "never" for time in (record.time_to_99_s, record.time_to_100_s)]
    violated = f", violates {record.violated}" if record.violated else ""
    ratio = f"{result.ratio:.2f} times the bound" if math.isfinite(result.ratio) else "no ratio"
    return f"{name}: 99 % {reached[0]}, 100 % {reached[1]}, {ratio} of {result.bound_s:.1f} s{violated}"


def write_report(results: Sequence[RobustnessResult], folder: StudyFolder) -> list[Path]:
    """Write robustness.html and robustness.png; return the files.

    Raises
    ------
    UserError
        The folder cannot be written.
    """
    from mpc_cover.view.robustness import draw_robustness  # noqa: PLC0415 - a second of matplotlib
    from mpc_cover.view.style import house_style, png_of  # noqa: PLC0415 - likewise

    ratios = {
        title: (*_axes(cells), {key: _worst_ratio(cell) for key, cell in cells.items()})
        for title, cells in tables_of(results).items()
    }
    with house_style():
        png = png_of(draw_robustness(ratios))
    picture = folder.write(folder.path / "robustness.png", png)
    text = document("mpc-cover study robustness", list(_page(results, png, folder)))
    return [folder.write(folder.path / "robustness.html", text.encode()), picture]


def _page(results: Sequence[RobustnessResult], png: bytes, folder: StudyFolder) -> Iterator[str]:
    yield f"<p>{escape(_verdict(results))}</p>"
    yield f'<img alt="worst ratios" src="data:image/png;base64,{base64.b64encode(png).decode()}">'
    yield "<h2>The worst</h2>"
    for result in _worst(results, _SHOWN):
        yield f"<p{'' if result.passes else ' class=bad'}>{escape(line_of(result))}</p>"
    yield from made_by(folder.commands)


def _verdict(results: Sequence[RobustnessResult]) -> str:
    """Return how many cases pass, in words."""
    passing = sum(result.passes for result in results)
    return f"{passing} of {len(results)} cases pass: covered, without a violation, within twice the bound"


def _worst_ratio(cell: Sequence[RobustnessResult]) -> float:
    """Return the worst ratio of the flights of a cell; NaN without any."""
    return max((result.ratio for result in cell if result.record is not None), default=math.nan)


def _worst(results: Sequence[RobustnessResult], limit: int) -> list[RobustnessResult]:
    return sorted(results, key=lambda result: (result.finished, -result.ratio if result.record else math.inf))[:limit]


def _axes(cells: dict[tuple[str, str], list[RobustnessResult]]) -> tuple[list[str], list[str]]:
    """Return the rows and the columns of a table."""
    return list(dict.fromkeys(row for row, _ in cells)), list(dict.fromkeys(column for _, column in cells))


def _style(cell: Sequence[RobustnessResult]) -> str:
    return "" if all(result.passes for result in cell) else "bold red"
