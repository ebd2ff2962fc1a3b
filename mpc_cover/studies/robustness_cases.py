"""The cases of the robustness study: every mission as it is, moved, scaled, turned, renumbered, at other periods."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from mpc_cover.control.controller_name import ControllerName
from mpc_cover.errors import UserError
from mpc_cover.mission.load import build_mission
from mpc_cover.service.protocol.fingerprint import mission_hash
from mpc_cover.studies.grid import Work
from mpc_cover.studies.mission_transforms import moved, renumbered, rotated, scaled, with_period
from mpc_cover.studies.robustness_shapes import crowds, islands, shapes
from mpc_cover.studies.runs import Run
from mpc_cover.studies.starts import Starts

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from mpc_cover.mission.load import Mission
    from mpc_cover.studies.mission_transforms import Raw

AS_IS = "as it is"
"""Column of the missions without any change."""
SHAPES, CROWDS = "shapes", "crowds"
"""Titles of the tables."""
_OFFSETS_M = ((30.0, 30.0), (-300.0, 1000.0), (500_000.0, 4_600_000.0), (1e7, 1e7))
_FACTORS = (1e-3, 1e-2, 10.0, 1e3)
_ANGLES_DEG = (17.0, 45.0, 90.0, 143.0)
_PERIODS_S = (0.25, 0.8, 1.0)
"""Parameters of the changes; plain choices. Of the offsets one is that of a UTM zone."""


@dataclass(frozen=True, eq=False)
class RobustnessCase:
    """One flight of the study.

    Attributes
    ----------
    table : title of the table it is in.
    shape : row of the table.
    change : column of the table.
    value : of the change, as "45 deg".
    mission : what is flown.
    """

    table: str
    shape: str
    change: str
    value: str
    mission: Mission

    @property
    def run(self) -> Run:
        """The flight, from the mission's own starts."""
        control, name = self.mission.spec.control, self.mission.spec.name
        text, steps = self.mission.to_json(), control.horizon_steps
        return Run(name, text, ControllerName.MPC, "native", steps, control.period_s, 0, Starts.MISSION)


def cases(only: Sequence[str] = ()) -> list[RobustnessCase]:
    """Return all cases, or those of some rows or columns of the table.

    Raises
    ------
    UserError
        A name in `only` is neither a row nor a column.
    """
    found = [*_changed(), *_crowded()]
    known = dict.fromkeys(name for case in found for name in (case.shape, case.change))
    for name in only:
        if name not in known:
            raise UserError(f"--only {name}: is none: must be among {', '.join(known)}")
    return [case for case in found if not only or {case.shape, case.change} & set(only)]


def work_of(some: Sequence[RobustnessCase]) -> Work:
    """Return the runs of cases."""
    prints = {case.mission.spec.name: mission_hash(case.mission) for case in some}
    return Work([case.run for case in some], prints, [])


def _changed() -> Iterator[RobustnessCase]:
    connected, parted = shapes(), islands()
    for shape, raw in {**connected, **parted}.items():
        yield _case(SHAPES, shape, AS_IS, "", raw)
        for offset in _OFFSETS_M:
            yield _case(SHAPES, shape, "moved", f"{offset[0]:.0f}, {offset[1]:.0f} m", moved(raw, offset))
        for factor in _FACTORS:
            yield _case(SHAPES, shape, "scaled", f"{factor:g}", scaled(raw, factor))
        for angle in _ANGLES_DEG if shape in connected else ():
            yield _case(SHAPES, shape, "turned", f"{angle:g} deg", rotated(raw, math.radians(angle)))
        for order in _orders(len(raw["fleet"]["agents"])):
            yield _case(
                SHAPES, shape, "renumbered", " ".join(str(index + 1) for index in order), renumbered(raw, order)
            )
        for period in _PERIODS_S:
            yield _case(SHAPES, shape, "period", f"{period:g} s", with_period(raw, period))


def _crowded() -> Iterator[RobustnessCase]:
    for formation, by_range in crowds().items():
        for reach, raw in by_range.items():
            yield _case(CROWDS, formation, reach, "", raw)


def _case(table: str, shape: str, change: str, value: str, raw: Raw) -> RobustnessCase:
    name = " ".join(part for part in (shape, change, value) if part).replace(" ", "-").replace(",", "")
    named = {**raw, "name": name}
    return RobustnessCase(table, shape, change, value, build_mission(named, f"mission {name}"))


def _orders(size: int) -> list[list[int]]:
    """Return orders of the agents: the reverse, and one place on where that differs."""
    agents = list(range(size))
    reverse, cycle = agents[::-1], [*agents[1:], 0]
    return [reverse] if reverse == cycle else [reverse, cycle]
