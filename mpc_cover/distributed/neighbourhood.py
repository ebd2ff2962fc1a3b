"""The agents around one agent, and the states that silent ones may be in."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.distributed.double_integrator_filter import StoppingBall, stopping_balls

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from mpc_cover.arrays import BoolArray, FloatArray, IntArray
    from mpc_cover.distributed.state_report import StateReport
    from mpc_cover.mission.fleet import Fleet


@dataclass(frozen=True, eq=False)
class Neighbourhood:
    """One agent's view of the others.

    Attributes
    ----------
    fleet : all agents.
    period_s : T_s.
    double : double integrators, or single ones, which stop where they are.
    lost_after : samples of silence after which an agent that brakes is at rest.
    margin_m : how far silent agents may be outside their stopping balls.
    """

    fleet: Fleet
    period_s: float
    double: bool
    lost_after: int
    margin_m: float

    def states(
        self, own: StateReport, newest: Mapping[int, StateReport], promised: Mapping[int, StateReport]
    ) -> tuple[list[StateReport], BoolArray, FloatArray]:
        """Return n states, whether each is of an agent heard now (n,), and how far from it the agent may be (n,) [m].

        An agent that was not heard is in its last state, or in the one that it promised after that, if it still acted
        on it; after a silence so long that it must be at rest, it is where it came to rest.
        """
        found: list[tuple[StateReport, bool, float]] = []
        for j, last in sorted(newest.items()):
            if last.sample == own.sample:
                found.append((last, True, 0.0))
                continue
            promise = promised.get(j)
            later = [promise] if promise is not None and promise.sample > last.sample else []
            rests = own.sample - last.sample > self.lost_after
            for each in (last, *later):
                state, uncertainty = self._at_rest(each) if rests else (each, 0.0)
                found.append((state, False, uncertainty + self.margin_m))
        return [each for each, _, _ in found], np.array([now for _, now, _ in found]), np.array([d for *_, d in found])

    def balls(self, states: list[StateReport]) -> tuple[FloatArray, FloatArray]:
        """Return (n, d) centres and (n,) radii [m] of what agents in n states occupy until they are at rest."""
        if not states:
            return np.empty((0, self.fleet.dimension)), np.empty(0)
        if not self.double:
            return np.array([each.position for each in states]), np.zeros(len(states))
        ball = self._stopping(states)
        return ball.centre, ball.radius

    def brake(self, own: StateReport) -> FloatArray:
        """Return the input (d,) that brakes [m/s^2]; of a single integrator the velocity zero."""
        return np.asarray(self._stopping([own]).force[0]) if self.double else np.zeros_like(own.position)

    def _at_rest(self, last: StateReport) -> tuple[StateReport, float]:
        """Return where an agent came to rest that braked from its last state, and how uncertain that is [m].

        It braked with all its input, or with less over whole samples (`double_integrator_filter`).
        """
        if not self.double:
            return last, 0.0
        speed = float(np.linalg.norm(last.velocity))
        latest = self._stopping([last]).stop[0]
        soonest = last.position + 0.5 * speed / float(self.fleet.input_max[last.agent]) * last.velocity
        rest = replace(last, position=0.5 * (soonest + latest), velocity=np.zeros_like(last.velocity))
        return rest, 0.5 * float(np.linalg.norm(latest - soonest))

    def _stopping(self, states: list[StateReport]) -> StoppingBall:
        position, velocity = np.array([each.position for each in states]), np.array([each.velocity for each in states])
        return stopping_balls(position, velocity, self.fleet.input_max[[each.agent for each in states]], self.period_s)


def keep_links(kept: BoolArray, rows: IntArray, heard: BoolArray, links: Sequence[tuple[int, int]]) -> None:
    """Add the mission's links (4.19) between those heard to the (n, n) edges kept of agents `rows` (n,), in place."""
    place = {int(agent): row for row, agent in enumerate(rows) if heard[row]}
    for one, two in links:
        if one in place and two in place:
            kept[place[one], place[two]] = kept[place[two], place[one]] = True
