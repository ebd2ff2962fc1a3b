"""The controller's record of the flight: the agents' motion between their reports, by the plans that they fly.

Undisturbed agents fly their plans to the last bit, so that plans and reports give their exact motion. Of a disturbed
one the motion of its reference is recorded, which stays within the tube of the true one.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.model.tube import start_tolerance
from mpc_cover.service.agent.schedule import Plant, Schedule
from mpc_cover.service.controller.fleet_monitor import planned_state
from mpc_cover.service.controller.plan_publisher import UnknownPlanError

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from mpc_cover.arrays import FloatArray
    from mpc_cover.mission.fleet import Fleet
    from mpc_cover.service.agent.recorder import Recorder
    from mpc_cover.service.agent.schedule import ScheduledPlan
    from mpc_cover.service.controller.fleet_monitor import AgentLink
    from mpc_cover.service.protocol.messages import PlanRef, State

    FindPlan = Callable[[int, PlanRef | None], ScheduledPlan | None]
    _Piece = tuple[float, FloatArray, FloatArray, FloatArray, PlanRef | None]


class FlightRecord:
    """Records each agent's motion, in the controller's clock.

    Parameters
    ----------
    recorders : a recorder of each agent.
    fleet : the agents.
    find : returns the plan with an id that was sent to an agent, by its number.
    """

    def __init__(self, recorders: Sequence[Recorder], fleet: Fleet, find: FindPlan) -> None:
        self._recorders, self._input_max, self._find = recorders, fleet.input_max, find
        self._tolerance = start_tolerance(fleet)
        self._last_s = [-np.inf] * len(recorders)
        self._reached: list[tuple[FloatArray, FloatArray] | None] = [None] * len(recorders)

    def add(self, index: int, link: AgentLink) -> None:
        """Record the motion of agent number `index` up to its newest report."""
        before, after = link.previous, link.state
        assert after is not None
        if before is not None:
            if after.at_rest and before.at_rest and after.position == before.position:
                return
            for time_s, position, velocity, force, ref in self._between(index, before, after):
                self._recorders[index].piece(self._at(index, time_s + link.offset), position, velocity, force, ref)
        elif (reached := self._reached[index]) is not None:
            self._brake(index, reached, after.time_s + link.offset)
        self._reached[index] = planned_state(after)
        self._recorders[index].mark(self._at(index, after.time_s + link.offset), *planned_state(after))

    def close(self, links: Sequence[AgentLink], now_s: float) -> None:
        """End the records at `now_s` of the controller's clock [s], where those who are at rest still are."""
        for index, link in enumerate(links):
            if link.state is not None:
                end_s = now_s if link.state.at_rest else link.measured_s()
                self._recorders[index].close(self._at(index, end_s), *planned_state(link.state))

    def _at(self, index: int, time_s: float) -> float:
        """Return a time of the record, which never runs backwards: offsets of clocks are corrected before a flight."""
        self._last_s[index] = max(self._last_s[index], time_s)
        return self._last_s[index]

    def _brake(self, index: int, reached: tuple[FloatArray, FloatArray], until_s: float) -> None:
        """Record that an agent whose process has died braked from the state that it had reached, until a time [s]."""

        def log(time_s: float, *motion: FloatArray | PlanRef | None) -> None:
            self._recorders[index].piece(self._at(index, time_s), *motion)  # type: ignore[arg-type]

        Plant(self._last_s[index], *reached, log).advance(until_s, Schedule(float(self._input_max[index])))

    def _between(self, index: int, before: State, after: State) -> list[_Piece]:
        """Return the pieces of motion between two reports: by the plans, or where they do not fit, by the reports."""
        pieces: list[_Piece] = []

        def log(*piece: float | FloatArray | PlanRef | None) -> None:
            pieces.append(piece)  # type: ignore[arg-type]

        plant = Plant(before.time_s, *planned_state(before), log)
        try:
            schedule = Schedule(float(self._input_max[index]), self._find(index, before.plan))
            for ref in dict.fromkeys((before.next_plan, after.plan)):
                if ref != before.plan and (plan := self._find(index, ref)) is not None:
                    schedule.add(plan)
        except UnknownPlanError:  # another controller's, whose flight this is not
            return [(*piece[:4], None) for piece in _fitted(before, after)]
        plant.advance(after.time_s, schedule)
        position, velocity = planned_state(after)
        off = max(np.abs(plant.position - position).max(), np.abs(plant.velocity - velocity).max())
        return pieces if off <= self._tolerance else _fitted(before, after)


def _fitted(before: State, after: State) -> list[_Piece]:
    """Return two pieces of equal duration that lead from one report to the next."""
    (q, v), (later_q, later_v) = planned_state(before), planned_state(after)
    half = 0.5 * (after.time_s - before.time_s)
    if half <= 0.0:
        return []
    gain, way = (later_v - v) / half, (later_q - q - 2.0 * half * v) / half**2
    first = way - 0.5 * gain
    middle = q + half * v + 0.5 * half**2 * first, v + half * first
    return [
        (before.time_s, q, v, first, before.plan),
        (before.time_s + half, *middle, gain - first, after.plan),
    ]
