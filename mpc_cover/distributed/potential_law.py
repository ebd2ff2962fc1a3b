"""The distributed law of chapters 5 and 6: each agent descends its potential, within bounds that are guaranteed.

An agent uses its own map, and the positions (and velocities) of those it hears. All functions work on a whole
fleet at once or on one agent's neighbourhood: rows that are not the caller's are computed and discarded.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.constraints.local_tree import kept_by_both, kept_by_either, local_choices, redundant_choices
from mpc_cover.distributed.double_integrator_filter import LESS, filter_forces, limited, stopping_balls, track
from mpc_cover.distributed.potential_functions import (
    Coordination,
    CoverageShape,
    collision_gradient,
    connectivity_gradient,
    coverage_gradient,
)
from mpc_cover.distributed.safe_sets import SafeSets, enclosing_diameters, safe_sets
from mpc_cover.distributed.single_integrator_filter import filter_steps
from mpc_cover.information.delay import adjacency

if TYPE_CHECKING:
    from mpc_cover.arrays import BoolArray, FloatArray


class EdgeRule(StrEnum):
    """Which local edges an agent keeps (6.1.2)."""

    BOTH = "both"
    """Those that both ends chose."""
    EITHER = "either"
    """Those that either end chose."""
    OWN = "own"
    """Its own choice, which needs no further message."""


@dataclass(frozen=True)
class LawParameters:
    """The law's tuning.

    Attributes
    ----------
    shape : of the coverage potential.
    gain : K of (5.16) [m^2/s per unit of gamma]; inf flies at u_max wherever the gradient is not zero.
    coordination_gain : of the gradients of (6.1) and (6.5) [m^2/s].
    random : largest length of the random signal r of (5.17), as a part of u_max.
    edges : which local edges an agent keeps.
    spare : whether edges are kept, too, that connect the others without any one agent (`local_tree.redundant_choices`).
    """

    shape: CoverageShape = field(default_factory=CoverageShape)
    gain: float = np.inf
    coordination_gain: float = 0.1
    random: float = 0.1
    edges: EdgeRule = EdgeRule.BOTH
    spare: bool = False


@dataclass(frozen=True, eq=False)
class Bounds:
    """The agents' limits.

    Attributes
    ----------
    speed_max : (m,) [m/s]; u_max of the single integrator (5.2).
    input_max : (m,) [m/s^2] of double integrators; None for single integrators.
    lower, upper : (d,) [m] box.
    """

    speed_max: FloatArray
    input_max: FloatArray | None
    lower: FloatArray
    upper: FloatArray


class PotentialLaw:
    """The law for a fleet or a neighbourhood.

    Parameters
    ----------
    cell : (K, d) centroids [m].
    bounds : of the agents, in the order of the rows of everything else.
    coordination : rho_B, R_B, rho_C, R_C.
    parameters : tuning.
    period : T_s [s].

    Raises
    ------
    ValueError
        Two agents that do not hear each other could meet within a step.
    """

    def __init__(
        self,
        cell: FloatArray,
        bounds: Bounds,
        coordination: Coordination,
        parameters: LawParameters,
        period: float,
    ) -> None:
        self._cell = cell
        self._bounds = bounds
        self._coordination = coordination
        self._parameters = parameters
        self._period = period
        self._require_range()

    def desired_velocity(
        self, position: FloatArray, weight: FloatArray, kept: BoolArray, signal: FloatArray
    ) -> FloatArray:
        """Return the velocities (m, d) [m/s] that the law asks for: -K grad F + r, within u_max (5.17, 6.9).

        Parameters
        ----------
        position : (m, d) [m].
        weight : gamma, (K,) of a shared map or (m, K) of each agent's own.
        kept : (m, m) edges.
        signal : (m, d) random, each of length 1 at the most.
        """
        speed = self._bounds.speed_max
        downhill = -coverage_gradient(position, self._cell, weight, self._parameters.shape)
        push = collision_gradient(position, self._coordination)
        push += connectivity_gradient(position, kept, self._coordination)
        noise = self._parameters.random * speed[:, None] * signal
        covering = _scaled(downhill, self._parameters.gain, speed)
        return limited(covering - self._parameters.coordination_gain * push + noise, speed)

    def kept_edges(self, position: FloatArray, velocity: FloatArray | None = None) -> BoolArray:
        """Return (m, m): the edges that each agent (row) keeps from (m, d) positions [m] and velocities [m/s]."""
        centre, radius = self._balls(position, velocity)
        weight, reach = enclosing_diameters(centre, radius), self._coordination.range_m
        choice = redundant_choices(weight, reach) if self._parameters.spare else local_choices(weight, reach)
        match self._parameters.edges:
            case EdgeRule.BOTH:
                return kept_by_both(choice)
            case EdgeRule.EITHER:
                return kept_by_either(choice)
            case EdgeRule.OWN:
                return choice

    def step(self, position: FloatArray, desired: FloatArray, kept: BoolArray) -> FloatArray:
        """Return the next positions (m, d) [m] of single integrators (5.1) that keep every bound.

        `desired` are the velocities (m, d) [m/s] that they should have.
        """
        sets = self._sets(position, position, np.zeros(len(position)), kept)
        longest = self._period * self._bounds.speed_max
        return position + filter_steps(position, self._period * desired, longest, sets)

    def force(
        self,
        position: FloatArray,
        velocity: FloatArray,
        desired: FloatArray,
        kept: BoolArray,
        uncertainty: FloatArray | None = None,
    ) -> FloatArray:
        """Return the inputs (m, d) [m/s^2] of double integrators that keep every bound and track the desired velocity.

        `desired` is (m, d) [m/s]; `uncertainty` (m,) [m] is how far each may be outside its stopping ball, 0 where it
        is left out.
        """
        assert self._bounds.input_max is not None, "single integrators take steps"
        limits = (self._bounds.input_max, self._bounds.speed_max)
        centre, radius = self._balls(position, velocity)
        sets = self._sets(position, centre, radius if uncertainty is None else radius + uncertainty, kept)
        wanted = track(velocity, desired, *limits, self._period)
        return filter_forces(position, velocity, wanted, limits, sets, self._period)[0]

    def _balls(self, position: FloatArray, velocity: FloatArray | None) -> tuple[FloatArray, FloatArray]:
        """Return (m, d) centres and (m,) radii [m] of what agents occupy until they are at rest."""
        if velocity is None or self._bounds.input_max is None:
            return position, np.zeros(len(position))
        ball = stopping_balls(position, velocity, self._bounds.input_max, self._period)
        return ball.centre, ball.radius

    def _sets(self, position: FloatArray, centre: FloatArray, radius: FloatArray, kept: BoolArray) -> SafeSets:
        return safe_sets(
            centre,
            radius,
            adjacency(position, self._coordination.range_m),
            kept,
            separation=self._coordination.separation_m,
            reach=self._coordination.range_m,
            box=(self._bounds.lower, self._bounds.upper),
        )

    def _require_range(self) -> None:
        """Refuse a range within which an agent does not hear all agents that it could meet."""
        if self._coordination.separation_m == 0.0:
            return
        speed = self._bounds.speed_max
        ahead = self._period * speed
        if self._bounds.input_max is not None:
            still, fastest = np.zeros((len(speed), 1)), LESS * speed[:, None]
            ahead = ahead + 2.0 * stopping_balls(still, fastest, self._bounds.input_max, self._period).radius
        need = self._coordination.separation_m + float(np.sort(ahead)[-2:].sum())
        if need > self._coordination.range_m:
            raise ValueError(
                f"communication range {self._coordination.range_m:g} m: must be at least {need:.3g} m, "
                "for agents to hear all that they could meet"
            )


def _scaled(vector: FloatArray, gain: float, longest: FloatArray) -> FloatArray:
    """Return (m, d) vectors times a gain, cut to (m,) lengths; an infinite gain gives the length itself."""
    if np.isfinite(gain):
        return limited(gain * vector, longest)
    length = np.linalg.norm(vector, axis=1)
    scale = np.divide(longest, length, out=np.zeros_like(length), where=length > 0.0)
    return np.asarray(scale[:, None] * vector)


def random_signal(rng: np.random.Generator, agents: int, dimension: int) -> FloatArray:
    """Return (m, d) random vectors, uniform in the unit ball (5.17)."""
    direction = rng.standard_normal((agents, dimension))
    direction /= np.maximum(np.linalg.norm(direction, axis=1), 1e-12)[:, None]
    return np.asarray(direction * rng.random((agents, 1)) ** (1.0 / dimension))
