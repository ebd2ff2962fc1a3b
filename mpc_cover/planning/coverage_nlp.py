"""The optimal coverage NLP (4.22, 4.34) in a form that `solvers.sqp` can convexify.

The decision vector of the SQP holds the positions at sample 0 and all velocities. They determine the inputs and the
other positions exactly, so that every iterate satisfies the dynamics whatever the QP's tolerance.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.constraints.graph import fleet_trees
from mpc_cover.constraints.pairs import pair_distances
from mpc_cover.constraints.passive_safety import braking_violations
from mpc_cover.coverage.majoriser import soft_cost
from mpc_cover.model.motion import path_extremes
from mpc_cover.planning.ocp import requirements
from mpc_cover.planning.subproblem import build_subproblem
from solvers.nlp import Measure

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray
    from mpc_cover.planning.ocp import OCP, Settings
    from solvers.nlp import ConvexModel


class CoverageNLP:
    """An OCP with its approximation settings; satisfies `solvers.nlp.Convexifiable` and `StepObserver`."""

    def __init__(self, ocp: OCP, settings: Settings) -> None:
        self.ocp = ocp
        self.settings = settings
        self.requirements = requirements(ocp, settings.margins)

    def measure(self, x: FloatArray) -> Measure:
        """Return J_beta [m] and the constraint violations, between samples as well."""
        ocp = self.ocp
        position, velocity = ocp.motion(x)
        cell, between = (ocp.cell, ocp.fleet.radius, ocp.weight), ocp.between(velocity)
        cost = soft_cost(position, *cell, self.settings.softness, ocp.looks, between)
        excess = self._excess(position, velocity)
        braking = braking_violations(position, velocity, ocp.period, ocp.fleet)
        penalty = float(sum(part.sum() for part in (*excess, braking)))
        return Measure(objective=cost, violation=_largest(excess), penalty=penalty)

    def violation(self, x: FloatArray) -> float:
        """Return the largest violation, without evaluating the cost."""
        return _largest(self._excess(*self.ocp.motion(x)))

    def convexify(self, x: FloatArray, radius: float) -> ConvexModel:
        """Return the QP around a decision vector; positions move by at most `radius` [m] along each axis."""
        return build_subproblem(self.ocp, self.settings, self.requirements, x, radius)

    def accepted(self, x_old: FloatArray, x_new: FloatArray, multipliers: FloatArray) -> None:  # noqa: ARG002
        """Pass an accepted iterate to the OCP's `on_iterate`."""
        if self.ocp.on_iterate is not None:
            self.ocp.on_iterate(x_new)

    def _excess(self, position: FloatArray, velocity: FloatArray) -> list[FloatArray]:
        """Return the violation of each constraint [m, m/s, m/s^2], 0 where it holds."""
        ocp, fleet = self.ocp, self.ocp.fleet
        limits = 1.0 - self.settings.margins.limits
        force = np.diff(velocity, axis=0) / ocp.period
        low, high = path_extremes(position, velocity, ocp.period)
        given = position[: ocp.first]
        over = [
            np.linalg.norm(velocity[ocp.first :], axis=2) - limits * fleet.speed_max,
            np.linalg.norm(force, axis=2) - limits * fleet.input_max,
            high - np.maximum(fleet.motion_max, given.max(axis=0, initial=-np.inf)),
            np.minimum(fleet.motion_min, given.min(axis=0, initial=np.inf)) - low,
        ]
        if fleet.size > 1:
            pairs = pair_distances(position, velocity, ocp.period)
            if fleet.separation_min > 0.0:
                over.append(self.requirements.separation - pairs.least)
            if np.isfinite(fleet.communication_range):
                tree = fleet_trees(pairs.most, fleet)
                over.append(np.where(tree, pairs.most - self.requirements.range, 0.0))
        return [np.maximum(part, 0.0) for part in over]


def _largest(excess: list[FloatArray]) -> float:
    return max(float(part.max(initial=0.0)) for part in excess)
