"""Bounds for a fleet whose state is outside its bounds: no tighter than what cannot be avoided from there.

A relay is lost, or a gust carries someone past a tightened bound: no plan from there keeps all bounds at once, and a
verifier that insists on them passes nothing, for ever. What braking at once would exceed is then allowed, and as
the next step starts on a plan that was accepted, what the rest of that plan exceeds: never more than before.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.verification.connectivity import widest_bottleneck
from mpc_cover.verification.ends import check_links
from mpc_cover.verification.motion import taking_part, verify_motion
from mpc_cover.verification.path import Path
from mpc_cover.verification.separation import smallest_separation

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mpc_cover.arrays import FloatArray
    from mpc_cover.mission.fleet import Fleet

    State = tuple[FloatArray, FloatArray]

_ROUNDING = 1e-6


@dataclass(frozen=True, eq=False)
class MotionBounds:
    """What plans are held to.

    Attributes
    ----------
    fleet : with the bounds of all.
    apart : {(i, j): rho_B [m]} of pairs that are nearer than the others may come.
    """

    fleet: Fleet
    apart: dict[tuple[int, int], float]

    @property
    def planned(self) -> Fleet:
        """The fleet as the planner is given it: no pair is asked for more than it can keep, and none for less."""
        return replace(self.fleet, apart=self.apart)

    @property
    def least_separation(self) -> float:
        """What every pair keeps [m]."""
        return min([self.fleet.separation_min, *self.apart.values()])

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
        return "separation of pairs that are too near already" if self.apart and not self._keeps_apart(path) else None

    def keeps_mixed(self, path: Path, other: Path) -> bool:
        """Return whether everyone stays apart and in touch whoever flies the `other` of two motions.

        Any number of them, as far as separation goes; in touch, if it is one alone. Both are of the same samples.
        """
        for index in self.fleet.active:
            mixed = []
            for own, others in (
                (path.position, other.position),
                (path.velocity, other.velocity),
                (path.force, other.force),
            ):
                one = own.copy()
                one[:, index] = others[:, index]
                mixed.append(one)
            motion = Path(path.time, *mixed)
            if longest_edge(motion, self.fleet) > self.fleet.communication_range + _ROUNDING:
                return False
            if not self._keeps_apart(motion):
                return False
        return True

    def _keeps_apart(self, path: Path) -> bool:
        if not self.apart and len(self.fleet.lost) < 2:  # noqa: PLR2004 - two that are lost may come near each other
            closest = smallest_separation(path)
            return closest is None or closest.value >= self.fleet.separation_min - _ROUNDING
        return all(
            value >= self.apart.get(pair, self.fleet.separation_min) - _ROUNDING
            for pair, value in _separations(path, self.fleet)
        )


def strict_bounds(fleet: Fleet) -> MotionBounds:
    """Return the fleet's own bounds."""
    return MotionBounds(fleet, {})


def attainable_bounds(fleet: Fleet, known: Sequence[Path], start: State) -> MotionBounds:
    """Return the fleet's own bounds if one of the `known` motions from `start` keeps them, else what the best attains.

    The best is the one that brings nobody nearer to anyone than it must, and then the one that tears least.
    """
    own = strict_bounds(fleet)
    if any(own.keeps(path, start) for path in known):
        return own

    def harm(bounds: MotionBounds) -> tuple[float, float]:
        nearest = fleet.separation_min - bounds.least_separation
        return max(nearest - _ROUNDING, 0.0), bounds.fleet.communication_range

    return min((relaxed(fleet, path) for path in known), key=harm)


def relaxed(fleet: Fleet, path: Path) -> MotionBounds:
    """Return the fleet's bounds where a motion keeps them, else what it attains.

    Speed counts at its start only: whoever is too fast must slow down.
    """
    here = list(fleet.active)
    speed = fleet.speed_max.copy()
    speed[here] = np.maximum(speed[here], np.linalg.norm(path.velocity[0, here], axis=1) + _ROUNDING)
    _, dense = path.dense(4)
    low, high = dense[:, here].min(axis=(0, 1)), dense[:, here].max(axis=(0, 1))
    close = {pair: value for pair, value in _separations(path, fleet) if value < fleet.separation_min}
    return MotionBounds(
        replace(
            fleet,
            speed_max=speed,
            motion_min=np.minimum(fleet.motion_min, low - _ROUNDING),
            motion_max=np.maximum(fleet.motion_max, high + _ROUNDING),
            communication_range=max(fleet.communication_range, longest_edge(path, fleet), _longest_link(path, fleet)),
        ),
        close,
    )


def longest_edge(path: Path, fleet: Fleet) -> float:
    """Return the longest edge [m] of the tree of those who take part, at any instant of a path; 0 for one agent."""
    widest = widest_bottleneck(taking_part(path, fleet)[0], limit=fleet.communication_range)
    return widest.value if widest is not None else 0.0


def _longest_link(path: Path, fleet: Fleet) -> float:
    """Return the longest of the links that must be kept [m], at any instant of a path, or a bit more; 0 for none."""
    return fleet.communication_range - check_links(path, fleet, 0.0).margin if fleet.links else 0.0


def _separations(path: Path, fleet: Fleet) -> list[tuple[tuple[int, int], float]]:
    """Return how near each pair comes [m] of which one takes part at least."""
    found = []
    for i, j in zip(*(index.tolist() for index in path.pair), strict=True):
        if i in fleet.active or j in fleet.active:
            pair = Path(path.time, path.position[:, [i, j]], path.velocity[:, [i, j]], path.force[:, [i, j]])
            closest = smallest_separation(pair)
            assert closest is not None
            found.append(((i, j), closest.value))
    return found
