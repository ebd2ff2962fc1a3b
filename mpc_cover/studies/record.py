"""The record of a study's run: a tidy row, and the two series that figures are drawn from."""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError, version
from typing import Any

import msgspec

from mpc_cover.version import __version__

LEVELS = tuple(0.5 * step for step in range(201))
"""Parts of the cells [%] for which a record has the times at which they were covered."""
_PACKAGES = ("numpy", "scipy", "piqp", "osqp", "clarabel")


class Record(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """One run. None is "never", "not asked for" or "does not apply".

    Attributes
    ----------
    key, mission, controller, backend, horizon_steps, period_s, seed, starts : the run's parameters, see `Run`.
    complete : whether the controller, or every agent without one, found everything covered and came to rest, in time.
    covered_percent, time_to_90_s, ... : by the motion flown, rounded down; see `RunSummary`.
    swath_bound_s, ratio_99 : T_b, and time_to_99_s over it.
    cost_left_m : J (4.34) of the motion flown, 0 when all is covered.
    effort_m2_per_s3 : the sum over agents of the integral of |u|^2.
    separation_margin_m : smallest distance along the continuous path less rho_B.
    violations, violated : how many of the independent verifier's checks fail, and which, by how much.
    step_p50_ms, ... : of the control steps, with prediction and publication; of agents without a controller, of each
        decision of each. The planning before the start is not included.
    misses : steps longer than the period.
    shifted, braked : steps whose plan was the previous one shifted, or the brake.
    wall_s : duration of the whole run, with verification.
    error : the exception that ended the run; such a run counts as not complete, and is flown again.
    curve_s : (201,) when each of `LEVELS` was reached.
    step_ms : of each control step.
    """

    key: str
    mission: str
    controller: str
    backend: str | None
    horizon_steps: int | None
    horizon_s: float | None
    period_s: float
    seed: int
    starts: str
    agents: int = 0
    cells: int = 0
    complete: bool = False
    covered_percent: float = 0.0
    time_to_90_s: float | None = None
    time_to_95_s: float | None = None
    time_to_99_s: float | None = None
    time_to_100_s: float | None = None
    swath_bound_s: float | None = None
    ratio_99: float | None = None
    cost_left_m: float | None = None
    duration_s: float | None = None
    distance_m: float | None = None
    effort_m2_per_s3: float | None = None
    smallest_separation_m: float | None = None
    separation_margin_m: float | None = None
    connected: bool | None = None
    violations: int | None = None
    violated: str = ""
    steps: int = 0
    step_p50_ms: float | None = None
    step_p99_ms: float | None = None
    step_max_ms: float | None = None
    misses: int = 0
    shifted: int = 0
    braked: int = 0
    prepare_s: float | None = None
    wall_s: float = 0.0
    error: str = ""
    versions: dict[str, str]
    curve_s: tuple[float | None, ...] = ()
    step_ms: tuple[float, ...] = ()


_SERIES = ("curve_s", "step_ms", "versions")


def columns() -> list[tuple[str, Any]]:
    """Return the names and types of a row, in order; those of versions are texts."""
    plain = [(field.name, field.type) for field in msgspec.structs.fields(Record) if field.name not in _SERIES]
    return plain + [(f"version_{name}", str) for name in versions()]


def row_of(record: Record) -> dict[str, Any]:
    """Return a record as a flat row."""
    row = {name: value for name, value in msgspec.structs.asdict(record).items() if name not in _SERIES}
    return row | {f"version_{name}": record.versions.get(name, "") for name in versions()}


def versions() -> dict[str, str]:
    """Return the versions that a result depends on, by package; empty for what is not installed."""
    found = {"mpc_cover": __version__}
    for name in _PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = ""
    return found
