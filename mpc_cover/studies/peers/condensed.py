"""The condensed NLP of the thesis (3.19 to 3.22): v = (z0, u) alone, states as linear maps of it, all dense.

Constraints are those of `asked_of_peers`, with the spanning trees of the motion that a solve starts from.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.constraints.pairs import all_pairs
from mpc_cover.coverage.majoriser import build_majoriser
from mpc_cover.studies.case import asked_of_peers, held_edges

if TYPE_CHECKING:
    from mpc_cover.arrays import BoolArray, FloatArray
    from mpc_cover.coverage.majoriser import Softness
    from mpc_cover.planning.ocp import OCP
    from mpc_cover.studies.case import Case


class Condensed:
    """One case as a function of its inputs, and of its first state where that is free.

    Vectors (n,) stack the free parts of q(0) and v(0) and the inputs u(0) to u(N-1).
    """

    def __init__(self, case: Case) -> None:
        self._case, self._ocp, self._required = case, case.ocp, asked_of_peers(case)
        ends, fleet = case.ocp.ends, case.ocp.fleet
        self._shape = (case.ocp.steps + 1, *fleet.start.shape)
        self._centre = 0.5 * (fleet.motion_min + fleet.motion_max)
        self._room = 0.5 * (fleet.motion_max - fleet.motion_min)
        each_coordinate = np.eye(fleet.start.size)
        to_q, to_v, to_u = (np.asarray(np.kron(each, each_coordinate), float) for each in _linear_maps(case.ocp))
        first = (ends.start_position, ends.start_velocity)
        fixed = np.zeros(to_q.shape[1])
        self._free = np.ones(to_q.shape[1], dtype=bool)
        for number, state in enumerate(first):
            if state is not None:
                place = slice(number * state.size, (number + 1) * state.size)
                fixed[place], self._free[place] = state.ravel(), False
        self._to_q = to_q[:, self._free]
        self._to_v = to_v[:, self._free]
        self._to_u = to_u[:, self._free]
        self._q0, self._v0 = to_q @ fixed, to_v @ fixed

    def pack(self, x: FloatArray) -> FloatArray:
        """Return v of a decision vector of the OCP."""
        position, velocity = self._ocp.motion(x)
        force = np.diff(velocity, axis=0) / self._ocp.period
        return np.asarray(np.concatenate([position[0].ravel(), velocity[0].ravel(), force.ravel()])[self._free])

    def unpack(self, v: FloatArray) -> FloatArray:
        """Return the decision vector of v."""
        return self._ocp.decision(self._position(v)[0], self._velocity(v))

    def cost(self, v: FloatArray, softness: Softness) -> tuple[float, FloatArray]:
        """Return J_beta (soft minimum over all samples) and its gradient (n,)."""
        ocp, points = self._ocp, self._shape[0] * self._shape[1]
        majoriser = build_majoriser(self._position(v), ocp.cell, ocp.fleet.radius, ocp.weight, softness, ocp.looks)
        gradient = majoriser.gradient(majoriser.level > 0.0, points)  # tight at the iterate, to first order
        return majoriser.cost, np.asarray(gradient.ravel() @ self._to_q)

    def ends(self) -> tuple[FloatArray, FloatArray]:
        """Return (C, c) of the equalities C v = c that the end asks for."""
        ends, size = self._ocp.ends, self._ocp.fleet.start.size
        matrix: list[FloatArray] = [np.zeros((0, self._to_q.shape[1]))]
        right: list[FloatArray] = [np.zeros(0)]
        for to, offset, target in (
            (self._to_q, self._q0, ends.end_position),
            (self._to_v, self._v0, ends.end_velocity),
        ):
            if target is not None:
                matrix.append(to[-size:])
                right.append(target.ravel() - offset[-size:])
            if ends.closed:
                matrix.append(to[-size:] - to[:size])
                right.append(offset[:size] - offset[-size:])
        return np.concatenate(matrix), np.concatenate(right)

    def edges(self, v: FloatArray) -> BoolArray:
        """Return (samples, pairs): the links and the minimum spanning trees of a motion; none where not asked for."""
        return held_edges(self._case, self._position(v))

    def slack(self, v: FloatArray, edges: BoolArray) -> FloatArray:
        """Return the (rows,) slacks, >= 0 where a constraint holds: discs, box, separation, edges."""
        fleet, first = self._ocp.fleet, self._ocp.first
        speed = np.sum(self._velocity(v)[first:] ** 2, axis=2)
        force = np.sum((self._to_u @ v).reshape(-1, *self._shape[1:]) ** 2, axis=2)
        off_centre = self._position(v)[first:] - self._centre
        parts: list[FloatArray] = [
            fleet.speed_max**2 - speed,
            fleet.input_max**2 - force,
            self._room**2 - off_centre**2,
        ]
        square, _ = self._squares(v)
        if fleet.size > 1 and fleet.separation_min > 0.0:
            parts.append(square - self._required.separation**2)
        return np.concatenate([*(part.ravel() for part in parts), self._required.range**2 - square[edges]])

    def slack_jacobian(self, v: FloatArray, edges: BoolArray) -> FloatArray:
        """Return (rows, n): the derivative of `slack`."""
        fleet, first, columns = self._ocp.fleet, self._ocp.first, v.size
        size = fleet.start.size
        to_v = self._to_v[first * size :].reshape(-1, fleet.dimension, columns)
        to_u = self._to_u.reshape(-1, fleet.dimension, columns)
        speed = np.einsum("rd,rdn->rn", self._velocity(v)[first:].reshape(-1, fleet.dimension), to_v)
        force = np.einsum("rd,rdn->rn", (self._to_u @ v).reshape(-1, fleet.dimension), to_u)
        off_centre = (self._position(v)[first:] - self._centre).ravel()
        parts = [-2.0 * speed, -2.0 * force, -2.0 * off_centre[:, None] * self._to_q[first * size :]]
        square = self._squares(v)[1]
        if fleet.size > 1 and fleet.separation_min > 0.0:
            parts.append(square.reshape(-1, columns))
        return np.concatenate([*parts, -square[edges]])

    def _squares(self, v: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return squared distances (samples, pairs) of the samples not given, and their derivative (..., n)."""
        one, two = all_pairs(self._ocp.fleet.size)
        first = self._ocp.first
        position = self._position(v)[first:]
        to_q = self._to_q.reshape(*self._shape, -1)[first:]
        apart = position[:, one] - position[:, two]
        slope = 2.0 * np.einsum("spd,spdn->spn", apart, to_q[:, one] - to_q[:, two])
        return np.sum(apart**2, axis=2), slope

    def _position(self, v: FloatArray) -> FloatArray:
        return np.asarray(self._to_q @ v + self._q0).reshape(self._shape)

    def _velocity(self, v: FloatArray) -> FloatArray:
        return np.asarray(self._to_v @ v + self._v0).reshape(self._shape)


def _linear_maps(ocp: OCP) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the maps of one coordinate's (q(0), v(0), u) to positions, velocities (N+1, .) and inputs (N, .)."""
    steps, period = ocp.steps, ocp.period
    n, k = np.arange(steps + 1)[:, None], np.arange(steps)[None]
    one, none = np.ones((steps + 1, 1)), np.zeros((steps + 1, 1))
    since = np.where(n > k, n - k - 0.5, 0.0)
    positions = np.hstack([one, period * n, period**2 * since])
    velocities = np.hstack([none, one, np.where(n > k, period, 0.0)])
    return positions, velocities, np.hstack([np.zeros((steps, 2)), np.eye(steps)])
