"""The result of a case of the robustness study: its time over the bound of its shape, and whether that will do."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from mpc_cover.studies.shape_bound import shape_bound

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from mpc_cover.studies.record import Record
    from mpc_cover.studies.robustness_cases import RobustnessCase

GREATEST_RATIO = 2.0
"""Time to 99 % over the bound of its shape, above which a flight counts as too slow; the aim of the study."""


@dataclass(frozen=True, eq=False)
class RobustnessResult:
    """One case and what became of it.

    Attributes
    ----------
    case : what was flown.
    record : None if it has not been flown yet.
    bound_s : about which no plan can be faster [s].
    """

    case: RobustnessCase
    record: Record | None
    bound_s: float

    @property
    def ratio(self) -> float:
        """Time to 99 % over the bound; inf where 99 % were never covered, NaN where it was not flown."""
        if self.record is None:
            return math.nan
        reached = self.record.time_to_99_s
        return math.inf if reached is None else reached / self.bound_s

    @property
    def finished(self) -> bool:
        """Whether everything was covered in time, without a violation."""
        return self.record is not None and self.record.complete and not self.record.violations

    @property
    def passes(self) -> bool:
        """Whether it is finished, and not too slow."""
        return self.finished and self.ratio <= GREATEST_RATIO

    def to_dict(self) -> dict[str, Any]:
        """Return the result as plain data; a ratio of None is "never"."""
        record, case = self.record, self.case
        return {
            "shape": case.shape,
            "change": case.change,
            "value": case.value,
            "mission": case.mission.spec.name,
            "time_to_99_s": record.time_to_99_s if record else None,
            "time_to_100_s": record.time_to_100_s if record else None,
            "bound_s": self.bound_s,
            "ratio": self.ratio if math.isfinite(self.ratio) else None,
            "complete": record.complete if record else False,
            "violated": record.violated if record else "",
            "error": record.error if record else "",
            "passes": self.passes,
        }


def results_of(some: Sequence[RobustnessCase], records: Sequence[Record]) -> Iterator[RobustnessResult]:
    """Yield the result of each case. Cases that take the same time by construction share the bound of their shape."""
    by_key: Mapping[str, Record] = {record.key: record for record in records}
    bounds: dict[str, float] = {}
    for case in some:
        if case.shape not in bounds:
            bounds[case.shape] = shape_bound(case.mission)
        yield RobustnessResult(case, by_key.get(case.run.key), bounds[case.shape])
