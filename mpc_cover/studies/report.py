"""The report of a study: figures, and one HTML file."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.studies.page import page
from mpc_cover.studies.record import LEVELS
from mpc_cover.studies.study_table import bound_of

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from mpc_cover.studies.results import StudyFolder
    from mpc_cover.studies.tally import Group
    from mpc_cover.view.study import Series


def write_report(groups: Mapping[str, Sequence[Group]], folder: StudyFolder) -> list[Path]:
    """Write report.html and the figures as PNG; return the files.

    Raises
    ------
    UserError
        The folder cannot be written.
    """
    from mpc_cover.view.study import study_figures  # noqa: PLC0415 - a second of matplotlib
    from mpc_cover.view.style import png_of  # noqa: PLC0415 - likewise

    figures = study_figures({mission: series_of(some) for mission, some in groups.items()})
    pictures = {name: png_of(figure) for name, figure in figures}
    text = page(groups, pictures, folder.commands)
    report = folder.write(folder.path / "report.html", text.encode())
    return [report, *(folder.write(folder.path / f"{name}.png", png) for name, png in pictures.items())]


def series_of(groups: Sequence[Group]) -> list[Series]:
    """Return the data of a mission's figures."""
    from mpc_cover.view.study import Series  # noqa: PLC0415 - a second of matplotlib

    levels = np.array(LEVELS)
    return [
        Series(
            label=group.label,
            level=levels,
            curve=np.array([_curve(record.curve_s) for record in group.records]),
            time_99=group.time_99_s,
            step_ms=group.step_ms,
            period_ms=1e3 * group.first.period_s,
            bound_s=bound_of(group),
        )
        for group in groups
    ]


def _curve(curve: Sequence[float | None]) -> list[float]:
    """Return a run's curve with inf for never; a run that broke off covered nothing."""
    known = [math.inf if time is None else time for time in curve]
    return known or [0.0] + [math.inf] * (len(LEVELS) - 1)
