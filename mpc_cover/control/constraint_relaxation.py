"""Constraint relaxation for a state from which the bounds are infeasible, by no more than is unavoidable.

After the loss of a relay, or when a gust carries an agent past a tightened bound, no plan satisfies all bounds, and a
verifier that insisted on them would reject every plan. The bounds are then relaxed to what immediate braking attains,
or, where it attains more, the rest of the incumbent plan. Since the incumbent was accepted under the previous bounds,
violations never grow from step to step.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.verification.connectivity import exchanged_bottlenecks, widest_bottleneck
from mpc_cover.verification.ends import check_links
from mpc_cover.verification.motion import taking_part, verify_motion
from mpc_cover.verification.path import Path
from mpc_cover.verification.separation import smallest_separations
from mpc_cover.verification.tolerance import tolerance_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mpc_cover.arrays import FloatArray
    from mpc_cover.model.fleet_constraints import FleetConstraints

    State = tuple[FloatArray, FloatArray]

_DENSE_PARTS = 4
"""Instants per sample interval at which the extent of a path is evaluated; a plain choice."""


@dataclass(frozen=True, eq=False)
class MotionBounds:
    """The bounds that plans must satisfy, relaxed where the state requires it.

    Attributes
    ----------
    fleet : with the bounds that hold for all agents.
    pair_separation : {(i, j): relaxed rho_B [m]} of pairs that are too near already.
    """

    fleet: FleetConstraints
    pair_separation: dict[tuple[int, int], float]

    @cached_property
    def planned(self) -> FleetConstraints:
        """The constraints for the planner: rho_B for all pairs but those that cannot keep it."""
        return replace(self.fleet, pair_separation=self.pair_separation)

    @property
    def least_separation(self) -> float:
        """The smallest distance that is required of any pair [m]."""
        return min([self.fleet.separation_min, *self.pair_separation.values()])

    def keeps(self, path: Path, start: State) -> bool:
        """Return whether a motion from `start`, (m, d) [m] and [m/s], satisfies the bounds and ends at rest."""
        return self.failure(path, start) is None

    def failure(self, path: Path, start: State) -> str | None:
        """Return the first bound that a motion from `start` violates, in words; None where it satisfies all.

        A step asks several times about what is one motion but for the rest at its end: it is verified once.
        """
        moving = _until_rest(path)
        key = (moving.velocity.tobytes(), moving.position.tobytes(), *(np.asarray(part).tobytes() for part in start))
        if key not in self._verified:
            self._verified[key] = self._failure(moving, start)
        return self._verified[key]

    @cached_property
    def _verified(self) -> dict[tuple[bytes, ...], str | None]:
        """What is known of motions."""
        return {}

    def _failure(self, path: Path, start: State) -> str | None:
        arrays = (path.time, path.position, path.velocity, path.force)
        least = replace(self.fleet, separation_min=self.least_separation)
        failed = verify_motion(least, *arrays, at_rest=True, start=start).first_failure
        if failed is not None:
            return f"{failed.name}: {failed.margin:.3g} {failed.unit} ({failed.where})"
        kept = not self.pair_separation or _far_enough(smallest_separations(path), self.planned.separations, self.fleet)
        return None if kept else "separation of a pair that is too near already"

    def keeps_mixed(self, path: Path, other: Path) -> bool:
        """Return whether separation and connectivity hold while some agents fly the `other` of two motions.

        Separation must hold for any set of such agents, connectivity for any single one. Samples are the same.
        """
        return self._mixed_connected(path, other) and self._mixed_separated(path, other)

    def _mixed_connected(self, path: Path, other: Path) -> bool:
        """Return whether the tree's edges stay within rho_C while any single agent flies the `other` motion."""
        if np.isinf(self.fleet.communication_range):
            return True
        longest = self.fleet.communication_range + tolerance_of(self.fleet)
        ours, theirs = taking_part(path, self.fleet)[0], taking_part(other, self.fleet)[0]
        # agents that this bound does not clear are checked exactly
        doubtful = np.flatnonzero(self.fleet.is_active)[exchanged_bottlenecks(ours, theirs) > longest]
        return all(longest_edge(_exchanged(path, other, index), self.fleet) <= longest for index in doubtful)

    def _mixed_separated(self, path: Path, other: Path) -> bool:
        """Return whether pairs keep their distance if one of them, or another agent, flies the `other` motion."""
        fleet, required = self.fleet, self.planned.separations
        first, second = path.pair
        a_third = len(fleet.active) > fleet.is_active[first].astype(int) + fleet.is_active[second]
        neither = smallest_separations(path, (first[a_third], second[a_third]))
        if not _far_enough(neither, required[a_third], fleet):
            return False
        one, two = np.concatenate([first, second]), np.concatenate([second, first])
        flies = fleet.is_active[one]
        mixed = smallest_separations(path.beside(other), (fleet.size + one[flies], two[flies]))
        return _far_enough(mixed, np.tile(required, 2)[flies], fleet)


def _until_rest(path: Path) -> Path:
    """Return a motion until it comes to rest for good."""
    moving = np.flatnonzero(path.velocity.any(axis=(1, 2)))
    last = min(int(moving[-1]) + 1 if moving.size else 1, path.velocity.shape[0] - 1)
    return Path(path.time[: last + 1], path.position[: last + 1], path.velocity[: last + 1], path.force[:last])


def strict_bounds(fleet: FleetConstraints) -> MotionBounds:
    """Return the fleet's own bounds."""
    return MotionBounds(fleet, {})


def attainable_bounds(fleet: FleetConstraints, known: Sequence[Path], start: State) -> MotionBounds:
    """Return the fleet's bounds if one of the `known` motions from `start` satisfies them, else what the best attains.

    The best motion reduces the distances of pairs least, and among those exceeds the communication range least. One
    that violates what is never relaxed, such as an input, cannot be flown, and is no measure.
    """
    own = strict_bounds(fleet)
    if any(own.keeps(path, start) for path in known):
        return own

    def violation(bounds: MotionBounds) -> tuple[float, float]:
        shortfall = fleet.separation_min - bounds.least_separation
        return max(shortfall - tolerance_of(fleet), 0.0), bounds.fleet.communication_range

    attained = [relaxed(fleet, path) for path in known]
    flyable = [bounds for bounds, path in zip(attained, known, strict=True) if bounds.keeps(path, start)]
    return min(flyable or attained, key=violation)


def relaxed(fleet: FleetConstraints, path: Path) -> MotionBounds:
    """Return the fleet's bounds where a motion satisfies them, else what it attains.

    Speed limits are relaxed to the speeds at its start only: an agent that is too fast must slow down.
    """
    active = list(fleet.active)
    speed, rounding = fleet.speed_max.copy(), tolerance_of(fleet)
    speed[active] = np.maximum(speed[active], np.linalg.norm(path.velocity[0, active], axis=1) + rounding)
    _, dense = path.dense(_DENSE_PARTS)
    low, high = dense[:, active].min(axis=(0, 1)), dense[:, active].max(axis=(0, 1))
    return MotionBounds(
        replace(
            fleet,
            speed_max=speed,
            motion_min=np.minimum(fleet.motion_min, low - rounding),
            motion_max=np.maximum(fleet.motion_max, high + rounding),
            communication_range=max(fleet.communication_range, longest_edge(path, fleet), _longest_link(path, fleet)),
        ),
        _too_near(path, fleet),
    )


def longest_edge(path: Path, fleet: FleetConstraints) -> float:
    """Return the longest edge [m] of the active agents' spanning tree at any instant of a path; 0 for one agent."""
    widest = widest_bottleneck(taking_part(path, fleet)[0], limit=fleet.communication_range)
    return widest.value if widest is not None else 0.0


def _longest_link(path: Path, fleet: FleetConstraints) -> float:
    """Return an upper bound on the longest fixed link at any instant of a path [m]; 0 without links."""
    return fleet.communication_range - check_links(path, fleet, 0.0).margin if fleet.links else 0.0


def _exchanged(path: Path, other: Path, index: int) -> Path:
    """Return `path` with the motion of agent `index` taken from `other`."""
    arrays = []
    for ours, theirs in (
        (path.position, other.position),
        (path.velocity, other.velocity),
        (path.force, other.force),
    ):
        mixed = ours.copy()
        mixed[:, index] = theirs[:, index]
        arrays.append(mixed)
    return Path(path.time, *arrays)


def _far_enough(least: FloatArray, required: FloatArray, fleet: FleetConstraints) -> bool:
    return bool((least >= required - tolerance_of(fleet)).all())


def _too_near(path: Path, fleet: FleetConstraints) -> dict[tuple[int, int], float]:
    """Return the least distance [m] of each pair that violates rho_B and has at least one active agent."""
    (first, second), least = path.pair, smallest_separations(path)
    near = (least < fleet.separation_min) & (fleet.is_active[first] | fleet.is_active[second])
    return dict(zip(zip(first[near].tolist(), second[near].tolist(), strict=True), least[near].tolist(), strict=True))
