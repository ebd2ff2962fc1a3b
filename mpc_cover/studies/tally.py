"""Statistics of a study's runs, grouped by mission, controller and horizon: medians and worst values."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import groupby
from typing import TYPE_CHECKING, Any

import numpy as np

from mpc_cover.verification.summary import floor_percent

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from mpc_cover.arrays import FloatArray
    from mpc_cover.studies.record import Record


@dataclass(frozen=True)
class Group:
    """Runs that differ by their seed only.

    Attributes
    ----------
    records : one or more.
    label : distinguishes the group from others of its mission.
    """

    records: tuple[Record, ...]
    label: str

    @property
    def first(self) -> Record:
        """Any of them, for the parameters that they share."""
        return self.records[0]

    @property
    def complete_percent(self) -> float:
        """Part of the runs that are complete, rounded down [%]."""
        return floor_percent(sum(record.complete for record in self.records), len(self.records))

    @property
    def errors(self) -> int:
        """How many broke off."""
        return sum(bool(record.error) for record in self.records)

    @property
    def violations(self) -> int:
        """How many checks failed, in all runs together."""
        return sum(record.violations or 0 for record in self.records)

    @property
    def violators(self) -> int:
        """How many runs violate something."""
        return sum(bool(record.violations) for record in self.records)

    @property
    def time_99_s(self) -> FloatArray:
        """(R,) [s]; inf where never."""
        return np.array([_or_never(record.time_to_99_s) for record in self.records])

    @property
    def ratio_99(self) -> FloatArray:
        """(R,) time to 99 % over the swath bound; inf where never, empty where the mission has no bound."""
        return np.array([_or_never(record.ratio_99) for record in self.records if self._bounded])

    @property
    def margin_m(self) -> float:
        """The smallest separation less rho_B of all runs [m]; inf where it was not asked for."""
        margins = [record.separation_margin_m for record in self.records]
        return min((margin for margin in margins if margin is not None), default=math.inf)

    @property
    def step_ms(self) -> FloatArray:
        """(S,) [ms] of all steps of all runs."""
        return np.concatenate([np.array(record.step_ms, dtype=float) for record in self.records])

    @property
    def step_p99_ms(self) -> float:
        """Of all steps of all runs; NaN without any."""
        return float(np.percentile(self.step_ms, 99)) if self.step_ms.size else math.nan

    @property
    def misses(self) -> int:
        """Steps longer than the period."""
        return sum(record.misses for record in self.records)

    @property
    def _bounded(self) -> bool:
        return any(record.swath_bound_s is not None for record in self.records)

    def to_dict(self) -> dict[str, Any]:
        """Return the group as plain data; None is "never" or "does not apply"."""
        shared = ("mission", "controller", "backend", "horizon_steps", "horizon_s", "period_s", "starts")
        return {name: getattr(self.first, name) for name in shared} | {
            "runs": len(self.records),
            "errors": self.errors,
            "complete_percent": self.complete_percent,
            "median_time_to_99_s": known(median(self.time_99_s)),
            "worst_time_to_99_s": known(worst(self.time_99_s)),
            "median_ratio_99": known(median(self.ratio_99)),
            "worst_ratio_99": known(worst(self.ratio_99)),
            "worst_separation_margin_m": known(self.margin_m),
            "violations": self.violations,
            "runs_with_violations": self.violators,
            "step_p99_ms": known(self.step_p99_ms),
            "worst_prepare_s": max(record.prepare_s or 0.0 for record in self.records),
            "misses": self.misses,
            "shifted": sum(record.shifted for record in self.records),
            "braked": sum(record.braked for record in self.records),
        }


def group(records: Iterable[Record]) -> dict[str, list[Group]]:
    """Return the groups of each mission; those that plan ahead first, by horizon."""
    ordered = sorted(records, key=lambda record: (record.mission, *_parameters(record)))
    found: dict[str, list[Group]] = {}
    for mission, theirs in groupby(ordered, key=lambda record: record.mission):
        several = list(theirs)
        parts = [tuple(part) for _, part in groupby(several, key=_parameters)]
        found[mission] = [Group(part, _label(part[0], several)) for part in parts]
    return found


def median(values: FloatArray) -> float:
    """Return the median; NaN of nothing, inf if half or more are."""
    return float(np.median(values)) if values.size else math.nan


def worst(values: FloatArray) -> float:
    """Return the largest; NaN of nothing."""
    return float(values.max()) if values.size else math.nan


def known(value: float) -> float | None:
    """Return a number, or None for one that is not finite."""
    return value if math.isfinite(value) else None


def _or_never(value: float | None) -> float:
    return math.inf if value is None else value


def _parameters(record: Record) -> tuple[Any, ...]:
    ahead = record.horizon_steps is not None
    steps, backend = record.horizon_s or 0.0, record.backend or ""
    return not ahead, record.controller, record.starts, record.period_s, backend, steps


def _label(record: Record, others: Sequence[Record]) -> str:
    """Return a name as short as it can be among the others."""

    def varies(of: Callable[[Record], object]) -> bool:
        return len({of(other) for other in others} - {None}) > 1

    parts = [record.controller]
    if record.horizon_s is not None:
        parts.append(f"{record.horizon_s:g} s")
    if record.backend is not None and varies(lambda other: other.backend):
        parts.append(record.backend)
    if varies(lambda other: other.period_s):
        parts.append(f"T {record.period_s:g} s")
    if varies(lambda other: other.starts):
        parts.append(f"{record.starts} start")
    return " ".join(parts)
