"""Sweeps of parts: each agent of a large fleet sweeps a part of its own around its start, all in the same pattern.

Strips and combs send large fleets across the whole area. Here agents and cells are bisected together, again and again
(Berger and Bokhari, IEEE Transactions on Computers 36, 1987), until each agent has a part with its share of the cells.
As neighbours fly the same pattern at the same time, their distances hardly change: separation and links are kept as
they were at the start. The work grows as m log m.
"""

from __future__ import annotations

from functools import partial
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.model.tolerances import AT_REST
from mpc_cover.model.trajectory import Trajectory
from mpc_cover.planning.initial_guess.boustrophedon import by_team, teams_of
from mpc_cover.planning.initial_guess.guess import Guess, GuessKind
from mpc_cover.planning.initial_guess.joint_polyline import fly_polyline
from mpc_cover.planning.initial_guess.lanes import cut_lanes
from mpc_cover.planning.initial_guess.waypoint_tracking import LIMIT_SHARE
from mpc_cover.planning.task import End

if TYPE_CHECKING:
    from collections.abc import Iterator

    from mpc_cover.arrays import FloatArray, IntArray
    from mpc_cover.planning.initial_guess.boustrophedon import Team
    from mpc_cover.planning.task import Task

AGENTS_MIN = 9
"""Agents from which on parts are swept: smaller fleets are planned as a whole. A plain choice."""


class PartSweeps:
    """Sweeps of one part of the demand for each agent, of fleets of at least `AGENTS_MIN`."""

    def guesses(self, task: Task, incumbent: Trajectory | None = None) -> Iterator[Guess]:  # noqa: ARG002 - from scratch
        """Yield the sweeps along each axis that begin in each corner of the parts."""
        if len(task.fleet.active) < AGENTS_MIN:
            return
        instants = task.fleet.look_instants
        look_s = 0.0 if instants.continuous else task.period / instants.per_step
        teams = teams_of(task.fleet, task.cell, task.weight, look_s, slow=False)
        still = np.abs(task.velocity).max(initial=0.0) <= AT_REST and not task.start_free and task.end is End.REST
        for axis, mirrored, upward in product(range(task.cell.shape[1]), (False, True), (True, False)):
            name = f"parts along axis {axis}{' mirrored' * mirrored}{' downward' * (not upward)}"
            sweeps = partial(_sweeps, position=task.position, axis=axis, mirrored=mirrored, upward=upward)
            guess = by_team(GuessKind.PARTS, name, task.position, teams, sweeps)
            yield guess
            if still:
                yield _together(task, guess)


def bisected(start: FloatArray, share: FloatArray, cell: FloatArray) -> list[IntArray]:
    """Return for each of the (m, d) starts [m] the indices of its part of the (K, d) cells [m].

    Parts are boxes' worth of cells next to each other, in proportion to `share` (m,), in the order of the starts.
    """
    parts = [np.empty(0, dtype=np.intp)] * len(start)
    waiting = [(np.arange(len(start)), np.arange(len(cell)))]
    while waiting:
        agents, cells = waiting.pop()
        if len(agents) == 1:
            parts[int(agents[0])] = cells
            continue
        axis = int(np.argmax(np.ptp(cell[cells], axis=0))) if len(cells) else 0
        agents = agents[np.argsort(start[agents, axis], kind="stable")]
        half = _gap(start[agents, axis])
        cells = cells[np.argsort(cell[cells, axis], kind="stable")]
        cut = round(len(cells) * float(share[agents[:half]].sum() / share[agents].sum()))
        waiting += [(agents[:half], cells[:cut]), (agents[half:], cells[cut:])]
    return parts


def _gap(place: FloatArray) -> int:
    """Return where to halve sorted places [m]: at the widest gap among the middle third."""
    low, high = max(1, len(place) // 3), min(len(place) - 1, -(-2 * len(place) // 3))
    gaps = place[low : high + 1] - place[low - 1 : high]
    widest = np.flatnonzero(gaps >= gaps.max() * (1.0 - np.finfo(float).eps * len(place))) + low
    return int(widest[np.argmin(np.abs(2 * widest - len(place)))])


def _sweeps(team: Team, position: FloatArray, axis: int, *, mirrored: bool, upward: bool) -> list[FloatArray]:
    """Return the paths of a team's agents through their parts, in as many lanes each, so that corners correspond."""
    here = position[team.agents]
    cells = [team.left[part] for part in bisected(here, team.speed, team.left)]
    count = max(len(cut_lanes(part, team.swath, axis)) for part in cells if len(part))
    paths = []
    for start, part in zip(here, cells, strict=True):
        lanes = cut_lanes(part, team.swath, axis, count) if len(part) else []
        ordered = lanes[::-1] if mirrored else lanes
        ends = [
            (lane.low, lane.high) if upward == (number % 2 == 0) else (lane.high, lane.low)
            for number, lane in enumerate(ordered)
        ]
        paths.append(np.array(ends).reshape(-1, here.shape[1]) if ends else start[None])
    return paths


def _together(task: Task, guess: Guess) -> Guess:
    """Return the guess flown from corner to corner at the same time: between corners no pair gets farther apart."""
    corners = max(len(path) for path in guess.paths)
    padded = [np.concatenate([path, np.repeat(path[-1:], corners - len(path), axis=0)]) for path in guess.paths]
    joint = np.concatenate([task.position[None], np.array(padded).swapaxes(0, 1)])
    limits = LIMIT_SHARE * task.fleet.speed_max, LIMIT_SHARE * task.fleet.input_max
    velocity = fly_polyline(joint, *limits, task.period, ())
    motion = Trajectory.from_velocities(task.position, velocity[0], velocity[1:], task.start_time, task.period)
    return Guess(guess.origin._replace(name=f"{guess.origin.name}, together"), motion=motion)
