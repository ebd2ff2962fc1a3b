"""The report as one self-contained HTML file: tables, figures, and how it was made."""

from __future__ import annotations

import base64
import os
import platform
from html import escape
from typing import TYPE_CHECKING

from mpc_cover.studies.record import versions
from mpc_cover.studies.study_table import HEADERS, row_of, title_of

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from mpc_cover.studies.tally import Group

STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; color: #222; max-width: 72rem; margin: 2rem auto; padding: 0 1rem; }
h1 { font-size: 1.6rem; } h2 { font-size: 1.2rem; margin-top: 2.2rem; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; font-size: 0.9rem; }
th, td { padding: 0.3rem 0.7rem; border-bottom: 1px solid #ddd; text-align: right; white-space: nowrap; }
th:first-child, td:first-child { text-align: left; } th { border-bottom: 2px solid #767676; }
.bad { color: #b3001b; font-weight: 600; } .wide { overflow-x: auto; }
img { max-width: 100%; height: auto; display: block; margin: 1rem 0; }
pre { background: #f4f4f2; padding: 0.7rem; overflow-x: auto; }
p.legend { color: #555; font-size: 0.9rem; max-width: 60rem; }
"""
_LEGEND = (
    "Times are those at which 99 % of the cells were covered, over all seeds; never counts as longer than any. "
    "The bound is T_b = (A - m pi rho^2) / (2 rho v_max m), about which no plan can be faster. The margin is the "
    "smallest distance between two agents along the continuous path, less rho_B. Violations are checks of the "
    "independent verifier that fail, in so many runs. Step times are of the machines that flew the runs, several "
    "at a time perhaps; without a controller a step is one agent's decision. A step is late when it takes longer than "
    "the period. The clock of a flight waits for the "
    "controller: nothing is cut short, neither late steps nor the planning before the start (prepare_s in runs.csv)."
)
_CAPTIONS = {
    "coverage": "Coverage over time: median and the band from 10 to 90 % of the runs; grey, the others' medians; "
    "dashed, the swath bound.",
    "time-to-99": "Time to 99 %: a point a run.",
    "step-time": "Step time: quartiles, 99th percentile and the longest.",
    "pareto": "Median time to 99 % against the 99th percentile of the step time; dashed, what nobody beats in both.",
}


def page(groups: Mapping[str, Sequence[Group]], pictures: Mapping[str, bytes], commands: Sequence[str]) -> str:
    """Return the report; `pictures` are PNGs by name."""
    parts = [*_tables(groups), *_figures(pictures), *_origin(groups, commands)]
    return document("mpc-cover study horizon", parts)


def document(title: str, parts: Sequence[str]) -> str:
    """Return a self-contained HTML document with a title, of `parts` that are HTML."""
    name, body = escape(title), "\n".join(parts)
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{name}</title>\n<style>{STYLE}</style>\n</head>\n<body>\n"
        f"<h1>{name}</h1>\n{body}\n</body>\n</html>\n"
    )


def _tables(groups: Mapping[str, Sequence[Group]]) -> Iterator[str]:
    for mission, some in groups.items():
        head = "".join(f"<th>{escape(header).replace(chr(10), '<br>')}</th>" for header in HEADERS)
        rows = "\n".join(f"<tr>{_cells(group)}</tr>" for group in some)
        yield f"<h2>{escape(title_of(mission, some))}</h2>"
        yield f'<div class="wide"><table>\n<tr>{head}</tr>\n{rows}\n</table></div>'
    yield f'<p class="legend">{escape(_LEGEND)}</p>'


def _cells(group: Group) -> str:
    return "".join(f"<td{' class=bad' * bad}>{escape(text)}</td>" for text, bad in row_of(group))


def _figures(pictures: Mapping[str, bytes]) -> Iterator[str]:
    yield "<h2>Figures</h2>"
    for name, png in pictures.items():
        caption = _CAPTIONS["coverage" if name.startswith("coverage-") else name]
        data = base64.b64encode(png).decode()
        yield f'<figure><img alt="{escape(name)}" src="data:image/png;base64,{data}">'
        yield f"<figcaption>{escape(caption)}</figcaption></figure>"


def _origin(groups: Mapping[str, Sequence[Group]], commands: Sequence[str]) -> Iterator[str]:
    """Yield the provenance: commands, versions of all runs, and the machine that wrote the report."""
    yield "<h2>How it was made</h2>"
    yield f"<pre>{escape(chr(10).join(commands))}</pre>"
    records = [record for some in groups.values() for group in some for record in group.records]
    found = {name: sorted({record.versions.get(name, "") for record in records}) for name in versions()}
    packages = ", ".join(f"{name} {' and '.join(numbers)}" for name, numbers in found.items())
    seconds = sum(record.wall_s for record in records)
    yield f"<p>{len(records)} runs, {seconds:.0f} s of flying in all. {escape(packages)}.</p>"
    yield f"<p>Written on {escape(machine())}.</p>"


def made_by(commands: Sequence[str]) -> Iterator[str]:
    """Yield how a page was made here: the commands, the versions and the machine."""
    yield "<h2>How it was made</h2>"
    yield f"<pre>{escape(chr(10).join(commands))}</pre>"
    yield f"<p>{escape(versions_line())}. {escape(machine())}.</p>"


def machine() -> str:
    """Return a description of this machine."""
    return f"Python {platform.python_version()}, {platform.system()} {platform.machine()}, {os.cpu_count()} cores"


def versions_line() -> str:
    """Return the versions that a result made here depends on."""
    return ", ".join(f"{name} {number}" for name, number in versions().items())
