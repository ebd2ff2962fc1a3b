"""How long a step of the information maps takes: `python -m mpc_cover.studies.map_timing`.

The target of 5 ms is for 10^5 cells and 50 agents. Two densities: discs of about 30 cells, and of about 3000.
"""

from __future__ import annotations

import sys
import time
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.information.effective import k_coverage
from mpc_cover.information.kalman import KalmanMap
from mpc_cover.information.scalar_field import NoisySensing, bumpy_field
from mpc_cover.information.visibility import Visibility
from mpc_cover.mission.config import Area, BoxShape
from mpc_cover.mission.field import build_field

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray
    from mpc_cover.information.residual_map import InformationMap

AGENTS = 50
ROWS = 317
"""Cells along each edge: 100,489 of them."""


def time_maps(cell_size_m: float, radius_m: float = 1.0, steps: int = 200, seed: int = 0) -> dict[str, FloatArray]:
    """Return the time [s] of each of (steps,) steps by map: `observe`, then gamma and the part that is done."""
    edge = ROWS * cell_size_m
    field = build_field(Area(shape=BoxShape(kind="box", min_m=(0.0, 0.0), max_m=(edge, edge)), cell_size_m=cell_size_m))
    seeing = Visibility(field, np.full((AGENTS, 1), radius_m))
    rng = np.random.default_rng(seed)
    path = rng.uniform(0.0, edge, (steps, AGENTS, 2))
    truth = bumpy_field(field.cell, rng)[None]
    reading = NoisySensing(seeing, truth, 1.0, rng)
    maps: dict[str, InformationMap] = {
        "plain": k_coverage(seeing, 1),
        "K = 15": k_coverage(seeing, 15),
        "Kalman": KalmanMap(seeing, variance=1.0, noise=1.0, enough=0.0625),
        "Kalman, drawing its readings": KalmanMap(reading, variance=1.0, noise=1.0, enough=0.0625),
    }
    return {name: _time(information, path) for name, information in maps.items()}


def _time(information: InformationMap, path: FloatArray) -> FloatArray:
    taken = []
    for step, position in enumerate(path):
        begun = time.perf_counter()
        information.observe(0.5 * step, position)
        _ = information.residual, information.fraction
        taken.append(time.perf_counter() - begun)
    return np.array(taken)


def main() -> None:
    """Print a line for each map and density."""
    lines = [f"{ROWS**2} cells, {AGENTS} agents, radius 1 m; ms a step: p50 / p99"]
    for cell_size in (0.317, 0.0317):
        for name, taken in time_maps(cell_size).items():
            p50, p99 = 1e3 * np.percentile(taken, (50, 99))
            lines.append(f"  cells of {cell_size:.4f} m  {name:<30} {p50:6.2f} / {p99:6.2f}")
    sys.stdout.write("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
