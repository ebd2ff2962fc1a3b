"""The style of all figures: colours that colour-blind readers can distinguish, and figures without global state."""

from __future__ import annotations

import io
from itertools import product
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patheffects import Normal, Stroke

if TYPE_CHECKING:
    from contextlib import AbstractContextManager
    from pathlib import Path

    from matplotlib.axes import Axes
    from matplotlib.patheffects import AbstractPathEffect

# Okabe and Ito's palette, in an order that keeps neighbours apart; Tol's indigo for their yellow,
# which is lost on covered cells, and no black, which is for text
_COLOURS = ("#0072B2", "#E69F00", "#009E73", "#CC79A7", "#56B4E9", "#D55E00", "#332288")
_LINES = ("-", (0, (5, 1.5)), (0, (1.5, 1)), (0, (5, 1.5, 1.5, 1.5)))

UNCOVERED = "#28323c"
COVERED = "#f3efe4"
INK = "#222222"
QUIET = "#767676"
LIMIT = "#b3001b"
GOOD = "#00704f"

_KEPT = ("backend", "backend_fallback", "interactive")
"""Settings of the user's session that are not a matter of style."""

_RC = {
    "font.family": "DejaVu Sans",
    "font.size": 10.5,
    "axes.titlesize": 11.5,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.edgecolor": QUIET,
    "axes.labelcolor": INK,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#e3e3e3",
    "grid.linewidth": 0.8,
    "lines.linewidth": 1.6,
    "legend.frameon": True,
    "legend.framealpha": 0.85,
    "legend.edgecolor": "none",
    "legend.fontsize": 9.0,
    "text.color": INK,
    "xtick.color": INK,
    "ytick.color": INK,
    "figure.facecolor": "white",
    "savefig.facecolor": "white",
}


def house_style() -> AbstractContextManager[None]:
    """Return the context in which figures are drawn: the same whatever the user's matplotlibrc."""
    defaults: Any = mpl.rcParamsDefault
    settings: Any = {name: defaults[name] for name in defaults if name not in _KEPT} | _RC
    return mpl.rc_context(settings)


def new_figure(width: float, height: float) -> Figure:
    """Return a figure [inches] on an Agg canvas; nothing of pyplot's global state is touched."""
    figure = Figure(figsize=(width, height), dpi=140, layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def save_figure(figure: Figure, file: Path) -> Path:
    """Write a figure as PNG; see `png_of`."""
    file.write_bytes(png_of(figure))
    return file


def png_of(figure: Figure) -> bytes:
    """Return a figure as PNG without date or version, so that the same figure gives the same bytes."""
    content = io.BytesIO()
    figure.savefig(content, format="png", metadata={"Software": None})
    return content.getvalue()


def agent_style(index: int) -> tuple[str, Any]:
    """Return an agent's colour and line style; after seven agents the colours repeat with another line style."""
    line, colour = list(product(_LINES, _COLOURS))[index % (len(_LINES) * len(_COLOURS))]
    return colour, line


def outlined(width: float, colour: str = "white") -> list[AbstractPathEffect]:
    """Return the effect that keeps a line or text readable on light and dark alike."""
    return [Stroke(linewidth=width, foreground=colour), Normal()]


def draw_limit(axes: Axes, value: float, label: str, colour: str = LIMIT, *, above: bool = True) -> None:
    """Draw a horizontal bound with its label at the right end of the line."""
    axes.axhline(value, color=colour, linewidth=1.4, linestyle=(0, (6, 2)), zorder=4)
    axes.annotate(
        label,
        (1.0, value),
        xycoords=("axes fraction", "data"),
        xytext=(-3, 3 if above else -3),
        textcoords="offset points",
        ha="right",
        va="bottom" if above else "top",
        color=colour,
        fontsize=9.0,
        path_effects=outlined(2.5),
        zorder=6,
    )
