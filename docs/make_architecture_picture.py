"""Draw the house from its real imports: docs/architecture.json is the graph, docs/architecture.png its picture.

Packages are those of the layers in pyproject.toml, and `solvers`. An import counts wherever it stands in a module, and
so does one for types alone. A test compares the graph with what the modules import.

Usage: python docs/make_architecture_picture.py
"""

from __future__ import annotations

import ast
import json
import math
import re
import textwrap
import tomllib
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, TypedDict

import matplotlib as mpl
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import FancyArrowPatch, FancyBboxPatch

if TYPE_CHECKING:
    from collections.abc import Iterator

    from matplotlib.axes import Axes

ROOT = Path(__file__).resolve().parents[1]
DATA, PICTURE = ROOT / "docs" / "architecture.json", ROOT / "docs" / "architecture.png"
APART = "solvers"
"""Knows nothing of coverage: it is in no layer."""
COLUMNS = {
    "cli": 3.4, "api": 6.2, "studies": 8.7, "service": 4.7, "control": 3.6, "distributed": 5.95, "planning": 3.6,
    "view": 8.7, "coverage": 2.3, "verification": 8.7, "constraints": 4.2, "information": 6.4, "trajectory_file": 8.7,
    "model": 3.2, "mission": 3.2, APART: 1.1,
}  # fmt: skip
"""Where a package stands in its layer, from 0 to 10; one that is not named here stands in the middle."""
BASEMENT = ("errors", "clock", "arrays", "version", "exit_status", "output")
"""Everyone may import these: no arrow leads there."""
JUDGES = ("verification", APART)
"""Drawn in another colour: they share no code with those whose work they judge or do."""
WIDTH, HEIGHT, LAYER = 2.12, 1.02, 1.42
WIDE = {"service": 5.2}
"""Boxes of another width."""


class Graph(TypedDict):
    """The layers from top to bottom, what each package says of itself and holds, and who imports whom how often."""

    layers: list[list[str]]
    says: dict[str, str]
    holds: dict[str, list[str]]
    imports: dict[str, dict[str, int]]


def graph_of(root: Path) -> Graph:
    """Return the graph of the packages under a checkout's root."""
    project = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))
    rows = project["tool"]["importlinter"]["contracts"][0]["layers"]
    layers = [[name.strip().removeprefix("mpc_cover.") for name in row.split("|")] for row in rows]
    packages = {name for layer in layers for name in layer} | {APART}
    count: Counter[tuple[str, str]] = Counter()
    for top in ("mpc_cover", APART):
        for file in sorted((root / top).rglob("*.py")):
            own = _package(".".join(file.relative_to(root).with_suffix("").parts), packages)
            for name in _imported(file):
                other = _package(name, packages)
                if own and other and own != other:
                    count[own, other] += 1
    imports = {one: {two: count[one, two] for two in sorted(packages) if count[one, two]} for one in sorted(packages)}
    return Graph(
        layers=layers,
        says={name: _says(root, name) for name in sorted(packages)},
        holds={name: _holds(root, name) for name in sorted(packages)},
        imports=imports,
    )


def _imported(file: Path) -> Iterator[str]:
    """Yield the modules that a file imports, a name for each import statement."""
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module:
            yield node.module
        elif isinstance(node, ast.Import):
            yield from (each.name for each in node.names)


def _package(module: str, packages: set[str]) -> str | None:
    """Return the package of a module, None for others' and for those in no layer."""
    parts = module.split(".")
    name = parts[0] if parts[0] == APART else parts[1] if parts[0] == "mpc_cover" and len(parts) > 1 else ""
    return name if name in packages else None


def _place(root: Path, name: str) -> Path:
    return root / name if name == APART else root / "mpc_cover" / name


def _holds(root: Path, name: str) -> list[str]:
    """Return the packages within a package."""
    return sorted(file.parent.name for file in _place(root, name).glob("*/__init__.py"))


def _says(root: Path, name: str) -> str:
    """Return the first sentence of a package's or a module's docstring."""
    place = _place(root, name)
    file = place / "__init__.py" if place.is_dir() else place.with_suffix(".py")
    said = ast.get_docstring(ast.parse(file.read_text(encoding="utf-8"))) or ""
    return " ".join(said.split("\n\n")[0].split()).split(". ")[0].rstrip(".")


def reduced(graph: Graph) -> dict[str, list[str]]:
    """Return for each package those it imports that it does not reach through another: what is drawn."""
    direct = {one: set(others) - set(BASEMENT) for one, others in graph["imports"].items()}

    def reached(name: str) -> set[str]:
        return direct[name].union(*(reached(other) for other in direct[name]))

    return {one: sorted(others - set().union(*(reached(other) for other in others))) for one, others in direct.items()}


def draw(graph: Graph) -> Figure:
    """Return the picture: a box a package, a row a layer, an arrow for what is imported."""
    bottom = -LAYER * (len(graph["layers"]) - 1)
    figure = Figure(figsize=(10.0, 0.62 - bottom), dpi=140)
    FigureCanvasAgg(figure)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set(xlim=(0.0, 10.0), ylim=(bottom, 0.62))
    axes.axis("off")
    places = _places(graph)
    for one, others in reduced(graph).items():
        for other in others:
            _arrow(axes, places[one], places[other], _width(one), graph["imports"][one][other])
    for name, place in places.items():
        _box(axes, name, graph["says"][name], graph["holds"][name] if name in WIDE else [], place)
    text = (
        f"{', '.join(BASEMENT)}: for everyone. Arrows: who imports whom, the wider the more often;\n"
        "those that follow from others are left out. Red: kept apart, it imports nothing of those it serves or judges."
    )
    axes.text(5.0, bottom + 0.42, text, ha="center", va="center", fontsize=10.0, color="#444444", linespacing=1.3)
    return figure


def _places(graph: Graph) -> dict[str, tuple[float, float]]:
    """Return the centre of each box."""
    rows = [[name for name in layer if name not in BASEMENT] for layer in graph["layers"]]
    places = {name: (COLUMNS.get(name, 5.0), -LAYER * row) for row, names in enumerate(rows) for name in names}
    return {**places, APART: (COLUMNS[APART], places["planning"][1])}


def _width(name: str) -> float:
    return WIDE.get(name, WIDTH)


def _box(axes: Axes, name: str, says: str, holds: list[str], place: tuple[float, float]) -> None:
    (x, y), width = place, _width(name)
    colour = "#b3001b" if name in JUDGES else "#00507a"
    corner, style = (x - width / 2, y - HEIGHT / 2), "round,pad=0.0,rounding_size=0.08"
    axes.add_patch(FancyBboxPatch(corner, width, HEIGHT, boxstyle=style, facecolor="white", edgecolor=colour, lw=1.6))
    axes.text(x, y + 0.35, name, ha="center", va="center", fontsize=12.5, fontweight="bold", color=colour)
    lines = "\n".join([*_wrapped(says, round(14.2 * width)), *([" · ".join(holds)] if holds else [])])
    axes.text(x, y - 0.12, lines, ha="center", va="center", fontsize=8.6, color="#222222", linespacing=1.15)


def _wrapped(says: str, width: int) -> list[str]:
    """Return a sentence in four lines at the most; one that is too long ends with its first part."""
    lines = textwrap.wrap(says, width)
    return lines if len(lines) <= 4 else textwrap.wrap(re.split("[:;]", says)[0], width)[:4]  # noqa: PLR2004


def _arrow(axes: Axes, one: tuple[float, float], two: tuple[float, float], room: float, imports: int) -> None:
    """Draw an arrow from below one box to above another, or sideways to one in the same row."""
    weight, aside = 0.9 + 0.45 * imports**0.5, two[0] - one[0]
    if one[1] == two[1]:
        start, end = (one[0], one[1]), (two[0] + math.copysign(WIDTH / 2, -aside), two[1])
    else:
        start = (one[0] + _within(0.45 * aside, 0.42 * room), one[1] - HEIGHT / 2)
        end = (two[0] - _within(0.2 * aside, 0.36 * WIDTH), two[1] + HEIGHT / 2)
    shape = f"-|>,head_width={2.0 + weight},head_length={3.0 + weight}"
    axes.add_patch(FancyArrowPatch(start, end, arrowstyle=shape, lw=weight, color="#8fa3b0", shrinkA=0, shrinkB=0))


def _within(value: float, most: float) -> float:
    return max(-most, min(most, value))


def save(graph: Graph, file: Path) -> None:
    """Draw the picture; the same graph gives the same bytes with the same matplotlib."""
    with mpl.rc_context(mpl.rcParamsDefault):
        draw(graph).savefig(file, metadata={"Software": None})


def main() -> None:
    """Write the graph and the picture."""
    graph = graph_of(ROOT)
    DATA.write_text(json.dumps(graph, indent=1, sort_keys=True) + "\n", encoding="utf-8")
    save(graph, PICTURE)


if __name__ == "__main__":
    main()
