"""Sweeps in formation: the fleet as one wide sensor, for fleets so tightly linked that agents cannot part.

Where links are hardly longer than a lane is wide, the sweeps of individual agents tear the fleet, and the SQP rarely
mends them. A formation keeps every distance. It is flown as it stands, stretched across the sweep as far as its links
allow, or unfolded to a line abreast; the lanes are as wide as the whole formation. It moves with the limits of its
slowest agent.

Passive safety: agents abreast of each other pass one that stops without warning. Where they fly behind each other they
would hit it, unless the gaps are longer than the way until they react. Such formations are guesses like others, and the
planner flies them only where no passively safe plan is sufficient.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import islice, permutations
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.constraints.graph import bottleneck, fleet_trees
from mpc_cover.constraints.pairs import all_pairs
from mpc_cover.model.tolerances import AT_REST
from mpc_cover.model.trajectory import Trajectory
from mpc_cover.planning.initial_guess.formation_lanes import Sensor, formation_lanes, needed_width
from mpc_cover.planning.initial_guess.guess import Guess, GuessKind, Origin
from mpc_cover.planning.initial_guess.joint_polyline import fly_polyline
from mpc_cover.planning.initial_guess.lanes import swath_of
from mpc_cover.planning.initial_guess.shape_change import Distances, chain_of, stretching, unfolding
from mpc_cover.planning.initial_guess.waypoint_tracking import LIMIT_SHARE
from mpc_cover.planning.ocp import Margins, requirements
from mpc_cover.planning.task import End

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from mpc_cover.arrays import BoolArray, FloatArray, IntArray
    from mpc_cover.planning.task import Task

_LANES_MAX = 1.5
"""Communication range in lanes from which on fleets need no formation. With 3 to 12 agents, sweeps of their own were
better at 1.6, worse at 1.3, as measured."""
_REST_COST = 4.0
"""Relative increase of a sweep's length per part of the demand that it leaves, where sweeps are ordered. Plain
choice."""
_YIELDED = 3
"""Sweeps that become guesses; a plain choice, as most of them are much alike."""


class FormationSweeps:
    """Sweeps of a tightly linked fleet in formation."""

    def guesses(self, task: Task, incumbent: Trajectory | None = None) -> Iterator[Guess]:  # noqa: ARG002 - from scratch
        """Yield the most promising sweeps, of all shapes along all axes; none unless the fleet is tightly linked.

        For a fleet at rest whose agents all measure what is demanded. The first is short and leaves little, and one
        that leaves nothing is among them, if there is one.
        """
        if (formation := formation_of(task)) is None:
            return
        found = [
            (float((task.remaining_after(motion) > 0.0).sum() / (task.weight > 0.0).sum()), motion.steps, name, motion)
            for name, motion in formation.sweeps()
        ]
        found.sort(key=lambda one: one[1] * (1.0 + _REST_COST * one[0]))
        complete = next((number for number, one in enumerate(found) if one[0] == 0.0), 0)
        best = found[:_YIELDED] if complete < _YIELDED else [*found[: _YIELDED - 1], found[complete]]
        for _, _, name, motion in best:
            yield Guess(Origin(GuessKind.FORMATION, name), motion=motion)


def link_lanes(task: Task) -> float:
    """Return the communication range in widths of a lane; inf without one, or where agents measure different things.

    Below 1, agents in neighbouring lanes are out of range; below 2, those with a lane between them.
    """
    sensor = _sensor(task)
    return np.inf if sensor is None else float(task.fleet.communication_range / (2.0 * sensor.half_width))


def _sensor(task: Task) -> Sensor | None:
    """Return the sensor of each agent of a formation; None where some cannot measure all that is demanded."""
    active, demanded = list(task.fleet.active), (task.weight > 0.0).any(axis=1)
    radius = task.fleet.radius[active][:, demanded]
    if not radius.size or not np.isfinite(radius).all():
        return None
    speed = LIMIT_SHARE * float(task.fleet.speed_max[active].min())
    swath = swath_of(float(radius.min()), speed, task.period)
    # in space, the cells of a lane are in a square inside the disc
    return Sensor(swath.radius, swath.half_width / float(np.sqrt(task.fleet.dimension - 1)))


def formation_of(task: Task) -> Formation | None:
    """Return the formation of a task, or None where it is no task for one."""
    fleet, active = task.fleet, list(task.fleet.active)
    still, sensor = np.abs(task.velocity).max(initial=0.0) <= AT_REST, _sensor(task)
    fits = still and not task.start_free and task.end is End.REST
    if not fits or len(active) < 2 or sensor is None or link_lanes(task) >= _LANES_MAX:  # noqa: PLR2004 - no formation
        return None
    cell = task.cell[(task.weight > 0.0).any(axis=0)]
    required = requirements(task.ocp(1), Margins())
    one, two = all_pairs(fleet.size)
    pair = np.flatnonzero(fleet.is_active[one] & fleet.is_active[two])
    length = np.linalg.norm(task.position[one] - task.position[two], axis=1)
    tree = fleet_trees(length[None], fleet)
    reach = max(required.range, float(bottleneck(length[None], tree)[0]))
    edges = np.flatnonzero(tree[0])
    number = {agent: index for index, agent in enumerate(active)}
    links = np.array([[number[int(one[e])], number[int(two[e])]] for e in edges if one[e] in number], dtype=np.intp)
    fixed = np.array([[number[i], number[j]] for i, j in fleet.links], dtype=np.intp).reshape(-1, 2)
    distances = Distances(required.separation[pair], reach)
    return Formation(task, cell, sensor, distances, links, fixed)


@dataclass(frozen=True, eq=False)
class Formation:
    """The active agents of a task as one body.

    Attributes
    ----------
    cell : (K, d) demanded cells [m].
    sensor : what each agent measures.
    distances : that all pairs keep.
    links : (a-1, 2) agents linked at the start, as indices among the active ones.
    fixed : (L, 2) those that must stay linked.
    """

    task: Task
    cell: FloatArray
    sensor: Sensor
    distances: Distances
    links: IntArray
    fixed: IntArray

    @cached_property
    def edges(self) -> IntArray:
        """(a-1+L, 2) all pairs that must stay within range."""
        return np.concatenate([self.links, self.fixed])

    @cached_property
    def linked(self) -> BoolArray:
        """(pairs,) which pairs those are, over `constraints.pairs.all_pairs`."""
        count = len(self.task.fleet.active)
        table = np.zeros((count, count), dtype=bool)
        table[self.edges.min(axis=1), self.edges.max(axis=1)] = True
        return np.asarray(table[all_pairs(count)])

    @property
    def start(self) -> FloatArray:
        """(a, d) positions of the active agents [m]."""
        return self.task.position[list(self.task.fleet.active)]

    def shapes(self, across: int) -> Iterator[tuple[str, list[FloatArray]]]:
        """Yield names of shapes and the shapes (a, d) [m] on the way to each, exclusive of the start.

        As the fleet stands, stretched, unfolded: the last two only as wide as the number of lanes requires.
        """
        start = self.start
        yield "formation", []
        stretched = stretching(start, self.links, across, np.inf, self.distances)
        if stretched is not None:
            width = needed_width(self.cell, float(np.ptp(stretched[:, across])), across, self.sensor)
            narrower = stretching(start, self.links, across, width, self.distances)
            if narrower is not None:
                yield f"formation, wide along axis {across}", [narrower]
        link = min(self.distances.reach, 2.0 * self.sensor.half_width)
        room = float(self.task.fleet.motion_max[across] - self.task.fleet.motion_min[across])
        chain = chain_of(start, self.distances.reach, across)
        if chain is not None:
            most = min(link * (len(chain) - 1), room)
            width = needed_width(self.cell, most, across, self.sensor)
            line = unfolding(start, chain, across, width, link, self.distances, room)
            if line is not None and all(self._keeps_fixed(shape) for shape in line):
                yield f"line abreast along axis {across}", line

    def sweeps(self) -> Iterator[tuple[str, Trajectory]]:
        """Yield names and motions of the sweeps of all shapes along all axes, with and without stops at lanes' ends."""
        for along, across in permutations(range(self.task.fleet.dimension), 2):
            rigid = across == (1 if along == 0 else 0)  # the same whatever is across
            for name, shapes in islice(self.shapes(across), 0 if rigid else 1, None):
                for stops in (False, True):
                    if (motion := self.sweep(shapes, along, stops=stops)) is not None:
                        yield f"{name}, along axis {along}{', stopping' * stops}", motion

    def sweep(self, shapes: list[FloatArray], along: int, *, stops: bool) -> Trajectory | None:
        """Return the sweep in the last of the shapes, which are taken on the way to the first lane; None for none."""
        start = self.start
        final = shapes[-1] if shapes else start
        here, centre = start.mean(axis=0), final.mean(axis=0)
        boxes = [self.room(shape - shape.mean(axis=0)) for shape in (*shapes, final)]
        if any((low > high).any() for low, high in boxes):
            return None
        lanes = formation_lanes(self.cell, final - centre, along, self.sensor, boxes[-1], here)
        if lanes is None:
            return None
        part = np.arange(1, len(shapes) + 1) / max(len(shapes), 1)
        changes = [
            shape - shape.mean(axis=0) + np.clip(here + share * (lanes[0] - here), *box)
            for shape, share, box in zip(shapes, part, boxes[:-1], strict=True)
        ]
        corners = np.array([start, *changes, *(point + final - centre for point in lanes[1 if shapes else 0 :])])
        first_end = len(changes) + (0 if shapes else 1)
        return self.fly(corners, range(first_end, len(corners)) if stops else ())

    def fly(self, corners: FloatArray, stopping: Sequence[int]) -> Trajectory:
        """Return the motion from corner to corner (W, a, d) [m] of the polyline, at rest in those of `stopping`."""
        fleet = self.task.fleet
        active = list(fleet.active)
        limits = (LIMIT_SHARE * fleet.speed_max[active], LIMIT_SHARE * fleet.input_max[active])
        velocity = fly_polyline(corners, *limits, self.task.period, stopping)
        whole = np.zeros((len(velocity), *self.task.position.shape))
        whole[:, active] = velocity
        start = self.task.position, whole[0]
        return Trajectory.from_velocities(*start, whole[1:], self.task.start_time, self.task.period)

    def room(self, shape: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return where the centre of a shape (a, d) [m] relative to it may be: low and high corners (d,) [m]."""
        fleet = self.task.fleet
        return fleet.motion_min - shape.min(axis=0), fleet.motion_max - shape.max(axis=0)

    def _keeps_fixed(self, shape: FloatArray) -> bool:
        """Return whether the links that must stay are within range in a shape (a, d) [m]."""
        length = np.linalg.norm(shape[self.fixed[:, 0]] - shape[self.fixed[:, 1]], axis=1)
        return bool((length <= self.distances.reach).all())
