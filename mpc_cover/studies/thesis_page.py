"""The figures of the thesis, reproduced, on one self-contained HTML page."""

from __future__ import annotations

import base64
from html import escape
from typing import TYPE_CHECKING

from mpc_cover.studies.page import document, made_by

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    from mpc_cover.studies.thesis_parts import Panel, PartResult
    from mpc_cover.studies.thesis_seeds import SeedTally

_CHAPTERS = {
    1: "Fleet sizing",
    3: "One sensor, planned offline",
    4: "Several sensors, planned offline",
    5: "The potential law with global knowledge",
    6: "The potential law with collision avoidance, connectivity and delayed maps",
}


def thesis_page(folder: Path, parts: Sequence[PartResult], tallies: Sequence[SeedTally], command: str) -> str:
    """Return the page; `folder` holds a folder with pictures for each part."""
    parts_of_page = [*_problems(parts, tallies), *_chapters(folder, parts), *_seeds(tallies), *made_by([command])]
    return document("The thesis's figures, as mpc-cover makes them", parts_of_page)


def _problems(parts: Sequence[PartResult], tallies: Sequence[SeedTally]) -> Iterator[str]:
    found = [problem for part in parts for problem in part.problems]
    found += [problem for tallied in tallies for problem in tallied.problems]
    if not found:
        yield "<p>Limits, separation and connectivity were verified along the continuous path: nothing failed.</p>"
    for problem in found:
        yield f'<p class="bad">{escape(problem)}</p>'


def _chapters(folder: Path, parts: Sequence[PartResult]) -> Iterator[str]:
    for chapter in sorted({part.chapter for part in parts}):
        yield f"<h2>Chapter {chapter}: {escape(_CHAPTERS.get(chapter, ''))}</h2>"
        for part in (part for part in parts if part.chapter == chapter):
            for panel in part.panels:
                yield _figure(folder / part.key, panel)
            yield f"<pre>{escape(part.command)}</pre>"


def _figure(folder: Path, panel: Panel) -> str:
    data = base64.b64encode((folder / panel.file).read_bytes()).decode()
    name = f"Figure {panel.number}" if panel.number[:1].isdigit() else panel.number
    facts = "".join(f"<br>{escape(fact)}" for fact in panel.facts)
    return (
        f'<figure><img alt="{escape(name)}" src="data:image/png;base64,{data}">'
        f"<figcaption><b>{escape(name)}</b>: {escape(panel.title)}{facts}</figcaption></figure>"
    )


def _seeds(tallies: Sequence[SeedTally]) -> Iterator[str]:
    if not tallies:
        return
    yield "<h2>Random starts</h2>"
    rows = "".join(f"<tr><td>{escape(each.text)}</td></tr>" for each in tallies)
    yield f"<table>{rows}</table>"
