"""Figure of the robustness study: the worst ratios as a heat map, a panel for each table."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.colors import LinearSegmentedColormap

from mpc_cover.view.style import COVERED, INK, LIMIT, new_figure

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from matplotlib.figure import Figure

    Ratios = tuple[Sequence[str], Sequence[str], Mapping[tuple[str, str], float]]

_SCALE = (1.0, 3.0)
"""Ratios of the first and the last colour; their middle is where a case is too slow."""


def draw_robustness(tables: Mapping[str, Ratios]) -> Figure:
    """Draw a table for each title: rows, columns, and the ratio by row and column; inf for never."""
    heights = [len(rows) for rows, _, _ in tables.values()]
    figure = new_figure(9.0, 0.34 * sum(heights) + 1.1 * len(heights))
    grid = figure.subplots(len(tables), 1, squeeze=False, height_ratios=heights).ravel()
    colours = LinearSegmentedColormap.from_list("ratio", ["#1b7f5c", COVERED, LIMIT]).with_extremes(bad="#00000000")
    for axes, (title, (rows, columns, ratio)) in zip(grid, tables.items(), strict=True):
        values = np.array([[ratio.get((row, column), math.nan) for column in columns] for row in rows])
        shown = np.ma.masked_invalid(np.where(np.isposinf(values), _SCALE[1], values))
        axes.imshow(shown, cmap=colours, vmin=_SCALE[0], vmax=_SCALE[1], aspect="auto")
        for (row, column), value in np.ndenumerate(values):
            if not math.isnan(value):
                text = "never" if math.isinf(value) else f"{value:.2f}"
                dark = value < 1.25 or value > 2.6  # noqa: PLR2004 - where the colours are dark
                axes.text(column, row, text, ha="center", va="center", fontsize=9, color="white" if dark else INK)
        axes.set_xticks(range(len(columns)), columns)
        axes.set_yticks(range(len(rows)), rows)
        axes.tick_params(length=0)
        axes.grid(visible=False)
        axes.set_title(f"{title}: worst time to 99 % over the bound")
    return figure
