"""Bounds for a fleet whose state is outside its bounds: no tighter than what cannot be avoided from there.

A relay is lost, or a gust carries someone past a tightened bound: no plan from there keeps all bounds at once, and a
verifier that insists on them passes nothing, for ever. What braking at once would exceed is then allowed, and as
the next step starts on a plan that was accepted, what the rest of that plan exceeds: never more than before.
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

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mpc_cover.arrays import FloatArray
    from mpc_cover.model.fleet_constraints import FleetConstraints

    State = tuple[FloatArray, FloatArray]

_ROUNDING = 1e-6


@dataclass(frozen=True, eq=False)
class MotionBounds:
    """What plans are held to.

    Attributes
    ----------
    fleet : with the bounds of all.
    pair_separation : {(i, j): rho_B [m]} of pairs that are nearer than the others may come.
    """

    fleet: FleetConstraints
    pair_separation: dict[tuple[int, int], float]

    @cached_property
    def planned(self) -> FleetConstraints:
        """The fleet as the planner is given it: no pair is asked for more than it can keep, and none for less."""
        return replace(self.fleet, pair_separation=self.pair_separation)

    @property
    def least_separation(self) -> float:
        """What every pair keeps [m]."""
        return min([self.fleet.separation_min, *self.pair_separation.values()])

    def keeps(self, path: Path, start: State) -> bool:
        """Return whether a motion from `start`, (m, d) [m] and [m/s], holds and ends at rest."""
        return self.failure(path, start) is None

    def failure(self, path: Path, start: State) -> str | None:
        """Return the first bound that a motion from `start` does not keep, in words; None where it keeps all."""
        arrays = (path.time, path.position, path.velocity, path.force)
        least = replace(self.fleet, separation_min=self.least_separation)
        failed = verify_motion(least, *arrays, at_rest=True, start=start).first_failure
        if failed is not None:
            return f"{failed.name}: {failed.margin:.3g} {failed.unit} ({failed.where})"
        kept = not self.pair_separation or _far_enough(smallest_separations(path), self.planned.separations)
        return None if kept else "separation of a pair that is too near already"

    def keeps_mixed(self, path: Path, other: Path) -> bool:
        """Return whether everyone stays apart and in touch whoever flies the `other` of two motions.

        Any number of them, as far as separation goes; in touch, if it is one alone. Both are of the same samples.
        """
        return self._mixed_in_touch(path, other) and self._mixed_apart(path, other)

    def _mixed_in_touch(self, path: Path, other: Path) -> bool:
        """Return whether the tree's edges keep to rho_C while one alone flies the `other` motion, whoever it is."""
        if np.isinf(self.fleet.communication_range):
            return True
        longest = self.fleet.communication_range + _ROUNDING
        ours, theirs = taking_part(path, self.fleet)[0], taking_part(other, self.fleet)[0]
        # whom the bound does not clear is looked at more closely
        doubtful = np.flatnonzero(self.fleet.is_active)[exchanged_bottlenecks(ours, theirs) > longest]
        return all(longest_edge(_exchanged(path, other, index), self.fleet) <= longest for index in doubtful)

    def _mixed_apart(self, path: Path, other: Path) -> bool:
        """Return whether pairs stay apart of whom one flies the `other` motion, or neither while someone else does."""
        fleet, asked = self.fleet, self.planned.separations
        first, second = path.pair
        someone_else = len(fleet.active) > fleet.is_active[first].astype(int) + fleet.is_active[second]
        neither = smallest_separations(path, (first[someone_else], second[someone_else]))
        if not _far_enough(neither, asked[someone_else]):
            return False
        one, two = np.concatenate([first, second]), np.concatenate([second, first])
        flies = fleet.is_active[one]
        mixed = smallest_separations(path.beside(other), (fleet.size + one[flies], two[flies]))
        return _far_enough(mixed, np.tile(asked, 2)[flies])


def strict_bounds(fleet: FleetConstraints) -> MotionBounds:
    """Return the fleet's own bounds."""
    return MotionBounds(fleet, {})


def attainable_bounds(fleet: FleetConstraints, known: Sequence[Path], start: State) -> MotionBounds:
    """Return the fleet's own bounds if one of the `known` motions from `start` keeps them, else what the best attains.

    The best is the one that brings nobody nearer to anyone than it must, and then the one that tears least. One that
    breaks what is never relaxed, as an input, cannot be flown, and attains nothing.
    """
    own = strict_bounds(fleet)
    if any(own.keeps(path, start) for path in known):
        return own

    def harm(bounds: MotionBounds) -> tuple[float, float]:
        nearest = fleet.separation_min - bounds.least_separation
        return max(nearest - _ROUNDING, 0.0), bounds.fleet.communication_range

    attained = [relaxed(fleet, path) for path in known]
    flyable = [bounds for bounds, path in zip(attained, known, strict=True) if bounds.keeps(path, start)]
    return min(flyable or attained, key=harm)


def relaxed(fleet: FleetConstraints, path: Path) -> MotionBounds:
    """Return the fleet's bounds where a motion keeps them, else what it attains.

    Speed counts at its start only: whoever is too fast must slow down.
    """
    here = list(fleet.active)
    speed = fleet.speed_max.copy()
    speed[here] = np.maximum(speed[here], np.linalg.norm(path.velocity[0, here], axis=1) + _ROUNDING)
    _, dense = path.dense(4)
    low, high = dense[:, here].min(axis=(0, 1)), dense[:, here].max(axis=(0, 1))
    return MotionBounds(
        replace(
            fleet,
            speed_max=speed,
            motion_min=np.minimum(fleet.motion_min, low - _ROUNDING),
            motion_max=np.maximum(fleet.motion_max, high + _ROUNDING),
            communication_range=max(fleet.communication_range, longest_edge(path, fleet), _longest_link(path, fleet)),
        ),
        _too_near(path, fleet),
    )


def longest_edge(path: Path, fleet: FleetConstraints) -> float:
    """Return the longest edge [m] of the tree of those who take part, at any instant of a path; 0 for one agent."""
    widest = widest_bottleneck(taking_part(path, fleet)[0], limit=fleet.communication_range)
    return widest.value if widest is not None else 0.0


def _longest_link(path: Path, fleet: FleetConstraints) -> float:
    """Return the longest of the links that must be kept [m], at any instant of a path, or a bit more; 0 for none."""
    return fleet.communication_range - check_links(path, fleet, 0.0).margin if fleet.links else 0.0


def _exchanged(path: Path, other: Path, index: int) -> Path:
    """Return a motion of which one agent flies the other."""
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


def _far_enough(least: FloatArray, asked: FloatArray) -> bool:
    return bool((least >= asked - _ROUNDING).all())


def _too_near(path: Path, fleet: FleetConstraints) -> dict[tuple[int, int], float]:
    """Return how near [m] those pairs come that come too near, and of which one takes part at least."""
    (first, second), least = path.pair, smallest_separations(path)
    near = (least < fleet.separation_min) & (fleet.is_active[first] | fleet.is_active[second])
    return dict(zip(zip(first[near].tolist(), second[near].tolist(), strict=True), least[near].tolist(), strict=True))
