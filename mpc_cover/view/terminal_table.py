"""Tables for a terminal, whose words stay whole: columns that are too wide together are wrapped between words."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich.box import SIMPLE_HEAD
from rich.table import Table
from rich.text import Text

if TYPE_CHECKING:
    from collections.abc import Sequence

_GAPS = (2, 1)
"""Characters between two columns, and where these are too many. Plain choices."""


def terminal_table(
    title: str, headers: Sequence[str], rows: Sequence[Sequence[str | Text]], room: int, *, left: Sequence[int] = (0,)
) -> Table:
    """Return a table that fits into `room` characters, as far as its longest words allow.

    Parameters
    ----------
    title : above it; wrapped between words.
    headers : of its columns, which may have several lines; none for a table without.
    rows : with a cell for each column.
    room : the width of the terminal.
    left : numbers of the columns that are flush left; figures are flush right.
    """
    shown = [[cell if isinstance(cell, Text) else Text(cell) for cell in row] for row in (headers, *rows) if row]
    widths, gap = _widths(shown, room)
    table = Table(
        title=Text(title, style="italic"),
        title_justify="left",
        box=SIMPLE_HEAD,
        padding=(0, gap - 1, 0, 0),  # the box has another one
        pad_edge=False,
        show_edge=False,
        show_header=bool(headers),
    )
    head = shown.pop(0) if headers else [Text()] * len(widths)
    for number, (width, header) in enumerate(zip(widths, head, strict=True)):
        table.add_column(header, justify="left" if number in left else "right", width=width)
    for row in shown:
        table.add_row(*row)
    return table


def _widths(rows: Sequence[Sequence[Text]], room: int) -> tuple[list[int], int]:
    """Return the widths of the columns, and the gap between two.

    Columns are as wide as their longest lines; where that is too much, whoever can spare most is made narrower. None is
    narrower than its longest word.
    """
    columns = list(zip(*rows, strict=True))
    widths = [max(len(line) for cell in column for line in cell.plain.split("\n")) for column in columns]
    least = [max((len(word) for cell in column for word in cell.plain.split()), default=1) for column in columns]
    gaps = len(widths) - 1
    gap = next((gap for gap in _GAPS if sum(widths) + gap * gaps <= room), _GAPS[-1])
    while sum(widths) + gap * gaps > room:
        spare = [width - word for width, word in zip(widths, least, strict=True)]
        if max(spare) <= 0:
            break
        widths[spare.index(max(spare))] -= 1
    return widths, gap
