"""Rendezvous of groups that are out of range of each other: the groups move towards each other until all gaps close.

After the loss of a relay this has priority, since agents out of range cannot receive plans. Each group moves as a
rigid formation, so that it stays connected, and all gaps close at once.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import zip_longest
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.constraints.graph import fleet_trees
from mpc_cover.constraints.pairs import all_pairs
from mpc_cover.model.braking import braking_velocities
from mpc_cover.model.tolerances import NO_DIRECTION
from mpc_cover.model.trajectory import Trajectory
from mpc_cover.planning.initial_guess.guess import Guess, GuessKind, Origin
from mpc_cover.planning.initial_guess.waypoint_tracking import track_waypoints

if TYPE_CHECKING:
    from collections.abc import Iterator

    from mpc_cover.arrays import BoolArray, FloatArray, IntArray
    from mpc_cover.model.fleet_constraints import FleetConstraints
    from mpc_cover.planning.task import Task

_MEETING_SHARE = 0.8
"""Part of the communication range within which groups meet, so that they reach the range itself at full speed. Plain
choice."""
_BENDS = (0.0, 1.5, -1.5, 3.0, -3.0)
"""Lateral detours around obstacles, in least distances rho_B; plain choices."""
_PASSES = 200
"""Passes over the gaps, each of which closes one gap after another and may reopen others a little; a plain choice."""
_GAP_TOLERANCE = 1e-3
"""Remaining gap, relative to the meeting distance, at which the passes end; a plain choice."""
_IMMOBILE_WEIGHT = 1e-6
"""Weight of a group that is to stay where it is; a plain choice, positive so that no sum of weights vanishes."""


def out_of_range(position: FloatArray, fleet: FleetConstraints) -> bool:
    """Return whether active agents at (m, d) positions [m] are out of range of each other: no connected graph."""
    length, tree = _tree(position, fleet)
    return bool((length[tree] > fleet.communication_range).any())


class Rendezvous:
    """Motions that close all gaps between groups that are out of range of each other."""

    def guesses(self, task: Task, incumbent: Trajectory | None = None) -> Iterator[Guess]:  # noqa: ARG002 - from scratch
        """Yield motions to the rendezvous, the fastest kinds first; lost agents do not move.

        Each is tried directly, and after braking to rest with equal limits within a group: different initial velocities
        may disconnect a group.
        """
        braking = braking_velocities(task.velocity, task.fleet, task.period)
        stop = Trajectory.from_velocities(task.position, task.velocity, braking, task.start_time, task.period)
        stopped = stop.position[-1]
        at_once, from_rest = ((position, _groups(position, task.fleet)) for position in (task.position, stopped))
        for direct, after_stop in zip_longest(_meetings(*at_once, task.fleet), _meetings(*from_rest, task.fleet)):
            for bend in _BENDS:
                if direct is not None:
                    paths = _detours(task.position, direct, bend * task.fleet.separation_min)
                    motion = track_waypoints(paths, task.position, task.velocity, task.fleet, task.period)
                    yield _guess(task, motion.velocity[1:])
                if after_stop is not None:
                    paths = _detours(stopped, after_stop, bend * task.fleet.separation_min)
                    motion = track_waypoints(
                        paths,
                        stopped,
                        np.zeros_like(stopped),
                        _with_equal_limits(task.fleet, from_rest[1]),
                        task.period,
                    )
                    yield _guess(task, np.concatenate([braking, motion.velocity[1:]]))


def _guess(task: Task, later: FloatArray) -> Guess:
    """Return the guess with velocities `later` (N, m, d) [m/s] at samples 1 to N."""
    motion = Trajectory.from_velocities(task.position, task.velocity, later, task.start_time, task.period)
    return Guess(Origin(GuessKind.RENDEZVOUS, "rendezvous"), motion=motion)


def _meetings(position: FloatArray, group: IntArray, fleet: FleetConstraints) -> Iterator[FloatArray]:
    """Yield the positions (m, d) [m] of all agents once all gaps are closed; first those to which all groups move."""
    return (_meeting(position, group, weights, fleet) for weights in _weights(group, fleet))


def _with_equal_limits(fleet: FleetConstraints, group: IntArray) -> FleetConstraints:
    """Return the fleet with the limits of the slowest agent of each group."""
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
    """Return the (m,) group index of each agent: agents joined by edges of the tree within the range."""
    length, tree = _tree(position, fleet)
    group = np.arange(fleet.size)
    for i, j, kept in zip(*all_pairs(fleet.size), tree & (length <= fleet.communication_range), strict=True):
        if kept:
            group[group == group[j]] = group[i]
    if len(set(group[fleet.is_active].tolist())) > 1:
        return group
    # all are connected, but barely: edges longer than the meeting distance are the gaps
    group = np.arange(fleet.size)
    for i, j, kept in zip(
        *all_pairs(fleet.size), tree & (length <= _MEETING_SHARE * fleet.communication_range), strict=True
    ):
        if kept:
            group[group == group[j]] = group[i]
    if len(set(group[fleet.is_active].tolist())) > 1:
        return group
    return np.arange(fleet.size)  # the gap is a fixed link that is too long, within one group


def _weights(group: IntArray, fleet: FleetConstraints) -> Iterator[FloatArray]:
    """Yield (m,) weights of how far each agent's group moves: all by their speed, then all but one group."""
    slowest = np.array([fleet.speed_max[(group == own) & fleet.is_active].min(initial=np.inf) for own in group])
    slowest[~fleet.is_active] = 0.0
    yield slowest
    for still in sorted(set(group[fleet.is_active].tolist())):
        yield np.where(group == still, _IMMOBILE_WEIGHT, slowest)


def _meeting(position: FloatArray, group: IntArray, weight: FloatArray, fleet: FleetConstraints) -> FloatArray:
    """Return positions (m, d) [m] with all gaps closed: each edge in turn moves its two groups towards each other."""
    near = _MEETING_SHARE * fleet.communication_range
    goal = position.copy()
    one, two = all_pairs(fleet.size)
    gaps = [(i, j) for i, j, kept in zip(one, two, _tree(position, fleet)[1], strict=True) if kept]
    for _ in range(_PASSES):
        worst = 0.0
        for i, j in gaps:
            if group[i] == group[j]:
                continue
            between = goal[j] - goal[i]
            distance = float(np.linalg.norm(between))
            if (excess := distance - near) <= 0.0:
                continue
            worst = max(worst, excess)
            move = (excess / distance / (weight[i] + weight[j])) * between
            goal[group == group[i]] += weight[i] * move
            goal[group == group[j]] -= weight[j] * move
        if worst < _GAP_TOLERANCE * near:
            break
    return np.where(fleet.is_active[:, None], goal, position)


def _detours(position: FloatArray, goal: FloatArray, aside: float) -> list[FloatArray]:
    """Return each agent's waypoints [m]: its goal; with a detour, halfway and goal displaced to the same side."""
    displacement = goal - position
    longest = displacement[np.argmax(np.linalg.norm(displacement, axis=1))]
    side = np.zeros_like(longest)
    side[:2] = -longest[1], longest[0]
    if (size := float(np.linalg.norm(side))) < NO_DIRECTION:  # straight up or down
        side, size = np.eye(longest.size)[0], 1.0
    bend = np.where((displacement != 0.0).any(axis=1)[:, None], aside / size * side, 0.0)
    if aside == 0.0:
        return list(goal[:, None])
    return list(np.stack([position + 0.5 * displacement + bend, goal + bend], axis=1))
