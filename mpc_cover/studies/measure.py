"""Flies, verifies and measures one run of a study; all controllers are measured in the same way."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

import numpy as np

from mpc_cover.control.control_law import PlanSource
from mpc_cover.coverage.objective import coverage_cost
from mpc_cover.studies.controllers import BACKEND, run_flight
from mpc_cover.studies.record import LEVELS, Record, versions
from mpc_cover.verification.check import check_trajectory
from mpc_cover.verification.summary import summarise

if TYPE_CHECKING:
    from collections.abc import Callable

    from mpc_cover.arrays import FloatArray
    from mpc_cover.studies.flight import Flight
    from mpc_cover.studies.runs import Run
    from mpc_cover.trajectory_file import Recording

    Fly = Callable[[Run], Record]


def fly(run: Run) -> Record:
    """Fly a run and return its record; an exception is kept in `error`, so that it does not end the study."""
    begun = time.perf_counter()
    try:
        found = measured(run_flight(run.build(), run.controller, backend=run.backend or BACKEND, seed=run.seed))
    except Exception as error:  # noqa: BLE001 - it is reported with the others
        return failed(run, error, time.perf_counter() - begun)
    return Record(**_parameters(run), **found, versions=versions(), wall_s=time.perf_counter() - begun)


def failed(run: Run, error: BaseException, wall_s: float = 0.0) -> Record:
    """Return the record of a run that could not be flown to its end."""
    text = " ".join(f"{type(error).__name__}: {error}".split())
    return Record(**_parameters(run), versions=versions(), wall_s=wall_s, error=text)


def measured(flight: Flight) -> dict[str, Any]:
    """Return the figures of a flight, by the record's names."""
    trajectory, mission = flight.trajectory, flight.trajectory.mission
    report = check_trajectory(trajectory)
    summary = summarise(trajectory, report, None)
    asked, closest = summary.separation_min_m, summary.smallest_separation_m
    held = np.diff(trajectory.time)
    return {
        "agents": mission.fleet.size,
        "cells": mission.field.size,
        "complete": flight.complete,
        "covered_percent": summary.covered_percent,
        "time_to_90_s": summary.time_to_90_s,
        "time_to_95_s": summary.time_to_95_s,
        "time_to_99_s": summary.time_to_99_s,
        "time_to_100_s": summary.time_to_100_s,
        "swath_bound_s": summary.swath_bound_s,
        "ratio_99": summary.ratio_to_bound,
        "cost_left_m": cost_left(trajectory),
        "duration_s": summary.duration_s,
        "distance_m": summary.distance_total_m,
        "effort_m2_per_s3": float(held @ (trajectory.input**2).sum(axis=(1, 2))),
        "smallest_separation_m": closest,
        "separation_margin_m": None if asked is None or closest is None else closest - asked,
        "connected": summary.connected,
        "violations": len(report.failures),
        "violated": "; ".join(f"{check.name} {check.margin:.3g} {check.unit}" for check in report.failures),
        "curve_s": coverage_curve(trajectory.covered_at),
        **_steps(flight, mission.spec.control.period_s),
    }


def coverage_curve(covered_at: FloatArray) -> tuple[float | None, ...]:
    """Return when [s] each of `LEVELS` of the (K,) cells was covered, None where never."""
    ordered = np.sort(covered_at)
    needed = np.ceil(np.array(LEVELS) / 100.0 * len(ordered) - 1e-9).astype(int)
    reached = np.concatenate([[0.0], ordered])[needed]
    return tuple(round(float(time), 6) if np.isfinite(time) else None for time in reached)


def cost_left(trajectory: Recording) -> float:
    """Return J (4.34) [m] of the motion flown: 0 when every cell was measured."""
    mission = trajectory.mission
    owed = np.isinf(trajectory.covered_at)
    if not owed.any():
        return 0.0
    radius = mission.fleet.radius
    weight = np.tile(mission.field.weight[owed], (radius.shape[1], 1))
    looks = np.full(weight.shape, mission.spec.looks, dtype=np.intp)
    return coverage_cost(trajectory.position, mission.field.cell[owed], radius, weight, looks)


def _steps(flight: Flight, period_s: float) -> dict[str, Any]:
    """Return the durations of the steps, and how many fell back to a shifted plan or to braking."""
    taken = 1e3 * flight.step_s
    found: dict[str, Any] = {
        "steps": len(taken),
        "misses": int((taken > 1e3 * period_s).sum()),
        "shifted": flight.plan_sources.count(PlanSource.SHIFTED.name),
        "braked": flight.plan_sources.count(PlanSource.BRAKE.name),
        "prepare_s": flight.prepare_s,
        "step_ms": tuple(round(float(ms), 3) for ms in taken),
    }
    if len(taken):
        p50, p99 = np.percentile(taken, (50, 99))
        found |= {"step_p50_ms": float(p50), "step_p99_ms": float(p99), "step_max_ms": float(taken.max())}
    return found


def _parameters(run: Run) -> dict[str, Any]:
    return {
        "key": run.key,
        "mission": run.name,
        "controller": run.controller,
        "backend": run.backend,
        "horizon_steps": run.horizon_steps,
        "horizon_s": run.horizon_s,
        "period_s": run.period_s,
        "seed": run.seed,
        "starts": str(run.starts),
    }
