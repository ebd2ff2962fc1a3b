"""`mpc-cover bench maps`: durations of a step of the information maps.

The target of 5 ms is for 10^5 cells and 50 agents. Two densities: discs of about 30 cells, and of about 3000.
"""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.information.effective import k_coverage
from mpc_cover.information.flight_map import FlightMap
from mpc_cover.information.kalman import KalmanMap
from mpc_cover.information.paced import PacedSensing
from mpc_cover.information.scalar_field import NoisySensing, bumpy_field
from mpc_cover.information.visibility import Visibility
from mpc_cover.mission.config import Area, BoxShape
from mpc_cover.mission.field import build_field

if TYPE_CHECKING:
    from collections.abc import Callable

    from mpc_cover.arrays import FloatArray
    from mpc_cover.information.residual_map import InformationMap

AGENTS = 50
ROWS = 317
"""Cells along each edge: 100,489 of them."""
DENSITIES_M = (0.317, 0.0317)
"""Edges of the cells [m]."""


def time_maps(
    cell_size_m: float,
    radius_m: float = 1.0,
    steps: int = 200,
    seed: int = 0,
    *,
    cpu_time: bool = False,
    on_progress: Callable[[str], None] = lambda _: None,
) -> dict[str, FloatArray]:
    """Return the time [s] of each of (steps,) steps by map: `observe`, then gamma and the part that is done.

    With `cpu_time` the processor's, for machines with other work to do.
    """
    edge = ROWS * cell_size_m
    field = build_field(Area(shape=BoxShape(kind="box", min_m=(0.0, 0.0), max_m=(edge, edge)), cell_size_m=cell_size_m))
    visibility = Visibility(field, np.full((AGENTS, 1), radius_m))
    rng = np.random.default_rng(seed)
    path = rng.uniform(0.0, edge, (steps, AGENTS, 2))
    truth = bumpy_field(field.cell, rng)[None]
    noisy = NoisySensing(visibility, truth, 1.0, rng)
    paced = PacedSensing(visibility, AGENTS, 0.5)
    maps: dict[str, InformationMap] = {
        "plain": k_coverage(visibility, 1),
        "K = 15": k_coverage(visibility, 15),
        "K = 15, in flight": FlightMap(k_coverage(paced, 15), paced, paced, graded=False),
        "Kalman": KalmanMap(visibility, variance=1.0, noise=1.0, enough=0.0625),
        "Kalman, drawing its readings": KalmanMap(noisy, variance=1.0, noise=1.0, enough=0.0625),
    }
    clock = time.thread_time if cpu_time else time.perf_counter
    found = {}
    for name, information in maps.items():
        on_progress(f"{name}, {cell_size_m:g} m cells")
        found[name] = _time(information, path, clock)
    return found


def _time(information: InformationMap, path: FloatArray, clock: Callable[[], float]) -> FloatArray:
    taken = []
    for step, position in enumerate(path):
        begun = clock()
        information.observe(0.5 * step, position)
        _ = information.residual, information.fraction
        taken.append(clock() - begun)
    return np.array(taken)


def measure_maps(
    steps: int, *, cpu_time: bool = False, on_progress: Callable[[str], None] = lambda _: None
) -> list[dict[str, str | float]]:
    """Return a row for each density and map: median and 99th percentile of a step [ms].

    `on_progress` is called with each map that is measured, in words.
    """
    rows: list[dict[str, str | float]] = []
    for cell_size_m in DENSITIES_M:
        for name, taken in time_maps(cell_size_m, steps=steps, cpu_time=cpu_time, on_progress=on_progress).items():
            p50, p99 = 1e3 * np.percentile(taken, (50, 99))
            cells = round(np.pi / cell_size_m**2)
            rows.append({"map": name, "cells_in_range": cells, "p50_ms": float(p50), "p99_ms": float(p99)})
    return rows
