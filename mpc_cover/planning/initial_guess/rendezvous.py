"""Rendezvous of groups that are out of range of each other: each flies towards the others.

After the loss of a relay nothing comes before this: those who cannot be reached cannot be warned. Each group moves as
one body, so that nobody in it is lost on the way, and all gaps close at once.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import zip_longest
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.constraints.graph import fleet_trees
from mpc_cover.constraints.pairs import all_pairs
from mpc_cover.model.braking import braking_velocities
from mpc_cover.model.trajectory import Trajectory
from mpc_cover.planning.initial_guess.guess import Guess, GuessKind, Origin
from mpc_cover.planning.initial_guess.waypoint_tracking import track_waypoints

if TYPE_CHECKING:
    from collections.abc import Iterator

    from mpc_cover.arrays import BoolArray, FloatArray, IntArray
    from mpc_cover.model.fleet_constraints import FleetConstraints
    from mpc_cover.planning.task import Task

NEAR = 0.8
"""Part of their range within which groups meet: they pass the range itself at full speed."""
_BENDS = (0.0, 1.5, -1.5, 3.0, -3.0)
"""Ways around what lies between, in least distances."""
_SWEEPS = 200
"""Passes over the gaps; each closes one gap after another, and may open others a little."""


def out_of_range(position: FloatArray, fleet: FleetConstraints) -> bool:
    """Return whether those who take part, at (m, d) [m], are out of range of each other."""
    length, tree = _tree(position, fleet)
    return bool((length[tree] > fleet.communication_range).any())


class Rendezvous:
    """Ways on which all gaps between groups that are out of range of each other close."""

    def guesses(self, task: Task, incumbent: Trajectory | None = None) -> Iterator[Guess]:  # noqa: ARG002 - from scratch
        """Yield motions to the meeting, the fastest kinds first; whoever is lost stays where it is.

        At once, or from rest and each group in step: velocities at the start may tear a group apart.
        """
        braking = braking_velocities(task.velocity, task.fleet, task.period)
        braked = Trajectory.from_velocities(task.position, task.velocity, braking, task.start_time, task.period)
        stopped = braked.position[-1]
        at_once, from_rest = ((place, _groups(place, task.fleet)) for place in (task.position, stopped))
        for now, then in zip_longest(_meetings(*at_once, task.fleet), _meetings(*from_rest, task.fleet)):
            for bend in _BENDS:
                if now is not None:
                    paths = _ways(task.position, now, bend * task.fleet.separation_min)
                    motion = track_waypoints(paths, task.position, task.velocity, task.fleet, task.period)
                    yield _guess(task, motion.velocity[1:])
                if then is not None:
                    paths = _ways(stopped, then, bend * task.fleet.separation_min)
                    motion = track_waypoints(
                        paths, stopped, np.zeros_like(stopped), _in_step(task.fleet, from_rest[1]), task.period
                    )
                    yield _guess(task, np.concatenate([braking, motion.velocity[1:]]))


def _guess(task: Task, later: FloatArray) -> Guess:
    """Return the guess with velocities `later` (N, m, d) [m/s] at samples 1 to N."""
    motion = Trajectory.from_velocities(task.position, task.velocity, later, task.start_time, task.period)
    return Guess(Origin(GuessKind.RENDEZVOUS, "rendezvous"), motion=motion)


def _meetings(position: FloatArray, group: IntArray, fleet: FleetConstraints) -> Iterator[FloatArray]:
    """Yield where everyone (m, d) [m] is once all gaps are closed, the more groups give way the earlier."""
    return (_meeting(position, group, weights, fleet) for weights in _weights(group, fleet))


def _in_step(fleet: FleetConstraints, group: IntArray) -> FleetConstraints:
    """Return the fleet with the limits of the slowest of each group."""
    return replace(
        fleet,
        speed_max=np.array([fleet.speed_max[group == own].min() for own in group]),
        input_max=np.array([fleet.input_max[group == own].min() for own in group]),
    )


def _tree(position: FloatArray, fleet: FleetConstraints) -> tuple[FloatArray, BoolArray]:
    one, two = all_pairs(fleet.size)
    length = np.linalg.norm(position[one] - position[two], axis=1)
    return length, fleet_trees(length[None], fleet)[0]


def _groups(position: FloatArray, fleet: FleetConstraints) -> IntArray:
    """Return the (m,) number of the group of each agent: those whom edges of the tree join that are short enough."""
    length, tree = _tree(position, fleet)
    group = np.arange(fleet.size)
    for i, j, kept in zip(*all_pairs(fleet.size), tree & (length <= fleet.communication_range), strict=True):
        if kept:
            group[group == group[j]] = group[i]
    if len(set(group[fleet.is_active].tolist())) > 1:
        return group
    # all hear each other, but hardly: the edges that are longer than they should be are the gaps
    group = np.arange(fleet.size)
    for i, j, kept in zip(*all_pairs(fleet.size), tree & (length <= NEAR * fleet.communication_range), strict=True):
        if kept:
            group[group == group[j]] = group[i]
    if len(set(group[fleet.is_active].tolist())) > 1:
        return group
    return np.arange(fleet.size)  # it is a link that is too long, between two whom others keep in touch


def _weights(group: IntArray, fleet: FleetConstraints) -> Iterator[FloatArray]:
    """Yield (m,) how much each agent's group gives way: all by their speed, then all but one."""
    slowest = np.array([fleet.speed_max[(group == own) & fleet.is_active].min(initial=np.inf) for own in group])
    slowest[~fleet.is_active] = 0.0
    yield slowest
    for still in sorted(set(group[fleet.is_active].tolist())):
        yield np.where(group == still, 1e-6, slowest)


def _meeting(position: FloatArray, group: IntArray, weight: FloatArray, fleet: FleetConstraints) -> FloatArray:
    """Return (m, d) [m] where everyone is once all gaps are closed: each edge in turn pulls its two groups."""
    near = NEAR * fleet.communication_range
    goal = position.copy()
    one, two = all_pairs(fleet.size)
    gaps = [(i, j) for i, j, kept in zip(one, two, _tree(position, fleet)[1], strict=True) if kept]
    for _ in range(_SWEEPS):
        worst = 0.0
        for i, j in gaps:
            if group[i] == group[j]:
                continue
            between = goal[j] - goal[i]
            distance = float(np.linalg.norm(between))
            if (excess := distance - near) <= 0.0:
                continue
            worst = max(worst, excess)
            pull = (excess / distance / (weight[i] + weight[j])) * between
            goal[group == group[i]] += weight[i] * pull
            goal[group == group[j]] -= weight[j] * pull
        if worst < 1e-3 * near:
            break
    return np.where(fleet.is_active[:, None], goal, position)


def _ways(position: FloatArray, goal: FloatArray, aside: float) -> list[FloatArray]:
    """Return each agent's waypoints [m]: its goal, or with a bend both halfway and there, all to the same side."""
    way = goal - position
    longest = way[np.argmax(np.linalg.norm(way, axis=1))]
    side = np.zeros_like(longest)
    side[:2] = -longest[1], longest[0]
    if (size := float(np.linalg.norm(side))) < 1e-9:  # noqa: PLR2004 - straight up or down
        side, size = np.eye(longest.size)[0], 1.0
    bend = np.where((way != 0.0).any(axis=1)[:, None], aside / size * side, 0.0)
    if aside == 0.0:
        return list(goal[:, None])
    return list(np.stack([position + 0.5 * way + bend, goal + bend], axis=1))
