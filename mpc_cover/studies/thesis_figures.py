"""The figures of chapters 1, 5 and 6 from our own runs: `python -m mpc_cover.studies.thesis_figures DIR`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.errors import UserError
from mpc_cover.studies.fleet_sizing import SizingProblem, measurement_rate
from mpc_cover.studies.sizing_simulation import coverage_curves
from mpc_cover.studies.swarm import run
from mpc_cover.studies.thesis_cases import KALMAN, LOOKS, constrained, free
from mpc_cover.view import swarm_figures
from mpc_cover.view.sizing_figures import figure_1_1, figure_1_2
from mpc_cover.view.style import house_style, save_figure

if TYPE_CHECKING:
    from collections.abc import Iterator

    from matplotlib.figure import Figure

AREA = SizingProblem(area_m2=100.0, radius_m=1.0, speed_m_per_s=1.5)
"""The thesis does not print the area of figures 1.1 and 1.2; this is ours."""
SEED = 1


def draw_figures(folder: str | Path, seed: int = SEED, only: tuple[str, ...] = ()) -> list[Path]:
    """Run what the figures show and write them as PNG into `folder`, which is made where it is missing.

    Parameters
    ----------
    seed : of the runs.
    only : figures by number, "5.1"; all when empty.

    Returns
    -------
    The files written.

    Raises
    ------
    UserError
        The folder cannot be written.
    """
    target = Path(folder)
    try:
        target.mkdir(parents=True, exist_ok=True)
        with house_style():
            return [
                save_figure(figure, target / f"figure-{name}.png")
                for chapter in (_sizing, _free, _constrained)
                for name, figure in chapter(seed, only)
                if _wanted(only, name)
            ]
    except OSError as error:
        raise UserError(f"figures: cannot write to {target}: {error.strerror or error}") from None


def _wanted(only: tuple[str, ...], *names: str) -> bool:
    return not only or any(name in only for name in names)


def _sizing(_: int, only: tuple[str, ...]) -> Iterator[tuple[str, Figure]]:
    if not _wanted(only, "1.1", "1.2"):
        return
    curves = coverage_curves(AREA)
    agents = np.arange(1.0, 21.0)
    rate = np.array([measurement_rate(AREA, int(number)) for number in agents])
    if _wanted(only, "1.1"):
        yield "1.1", figure_1_1(curves)
    if _wanted(only, "1.2"):
        yield "1.2", figure_1_2(agents, rate, AREA.cover, curves)


def _free(seed: int, only: tuple[str, ...]) -> Iterator[tuple[str, Figure]]:
    """Yield chapter 5's."""
    if _wanted(only, "5.1", "5.2"):
        looks = run(free(LOOKS, maps_every=1), seed)
        yield "5.1", swarm_figures.figure_5_1(looks)
        yield "5.2", swarm_figures.figure_5_2(looks)
    if _wanted(only, "5.3", "5.4"):
        kalman = run(free(KALMAN, maps_every=1), seed)
        yield "5.3", swarm_figures.figure_5_3(kalman)
        yield "5.4", swarm_figures.figure_5_4(kalman)


def _constrained(seed: int, only: tuple[str, ...]) -> Iterator[tuple[str, Figure]]:
    """Yield chapter 6's; each is compared with the same start under global knowledge."""
    if _wanted(only, "6.2", "6.3"):
        looks = run(constrained(LOOKS, maps_every=1), seed)
        yield "6.2", swarm_figures.figure_6_2(looks)
        yield "6.3", swarm_figures.figure_6_3(looks, run(constrained(LOOKS, 0), seed))
    if _wanted(only, "6.4", "6.5"):
        kalman = run(constrained(KALMAN, maps_every=1), seed)
        yield "6.4", swarm_figures.figure_6_4(kalman, run(constrained(KALMAN, 0), seed))
        yield "6.5", swarm_figures.figure_6_5(kalman)


def main() -> None:
    """Draw all figures into the folder named."""
    folder = sys.argv[1] if len(sys.argv) > 1 else "thesis-figures"
    for file in draw_figures(folder):
        sys.stdout.write(f"{file}\n")


if __name__ == "__main__":
    main()
