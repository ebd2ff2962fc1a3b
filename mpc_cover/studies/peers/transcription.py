"""The NLP (4.22, 4.34) transcribed for CasADi: states at all samples as variables, sparse dynamics between them.

Inputs are eliminated, u(n) = (v(n+1) - v(n)) / T_s, as in our own QPs. Compared on box-3 with IPOPT, the
condensed form took twice as long. The constraints are those of the thesis at the samples, with the margins
of `asked_of_peers`. The edges of (4.20) are the minimum spanning trees of the motion that a solve starts from,
sample by sample, chosen anew before each stage: smooth rows, that grow with the square of the fleet. With the exact
longest edge instead (a minimum over paths of maxima, with kinks where the tree changes) IPOPT ended no better.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import casadi as cs
import numpy as np

from mpc_cover.constraints.pairs import all_pairs
from mpc_cover.studies.case import asked_of_peers, held_edges
from mpc_cover.studies.peers.symbolic_cost import excesses, hard_cost, soft_cost, soft_hessian

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray
    from mpc_cover.studies.case import Case


class Transcription:
    """One case for CasADi's solvers: minimise f(w, p) subject to bounds on w and on g(w).

    w holds all positions, then all velocities, at samples 0 to N; p is (beta [1/m], margin [m]).

    Attributes
    ----------
    nlp : the expressions x (w), p, f, g.
    lower, upper : (w,) bounds on w: the motion box, and both ends where they are given.
    """

    def __init__(self, case: Case, *, soft: bool) -> None:
        self._case, self._required = case, asked_of_peers(case)
        ocp = case.ocp
        self.half = (ocp.steps + 1) * ocp.fleet.start.size
        w, p = cs.MX.sym("w", 2 * self.half), cs.MX.sym("p", 2)
        agents, dimension = ocp.fleet.start.shape
        points = cs.reshape(w[: self.half], dimension, (ocp.steps + 1) * agents)
        self._parts = excesses(case, points)
        self._rows: list[Any] = []
        self._bounds: list[tuple[FloatArray, FloatArray]] = []
        self._add_motion(w)
        self._first_edge = int(sum(low.size for low, _ in self._bounds))
        self._add_pairs(w)
        cost = soft_cost(self._parts, p[0], p[1]) if soft else hard_cost(self._parts, p[1])
        self.nlp = {"x": w, "p": p, "f": cost, "g": cs.vertcat(*self._rows)}
        self.lower, self.upper = self._variable_bounds()

    def pack(self, x: FloatArray) -> FloatArray:
        """Return w of a decision vector of the OCP."""
        position, velocity = self._case.ocp.motion(x)
        return np.concatenate([position.ravel(), velocity.ravel()])

    def unpack(self, w: FloatArray) -> FloatArray:
        """Return the decision vector of w: its start and velocities, rolled out from there on."""
        size = self._case.ocp.fleet.start.size
        return np.concatenate([w[:size], w[self.half :]])

    def row_bounds(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the bounds on g, with the spanning trees of the motion `x`."""
        lower = np.concatenate([low for low, _ in self._bounds])
        upper = np.concatenate([high for _, high in self._bounds])
        fleet = self._case.ocp.fleet
        if fleet.size > 1 and np.isfinite(fleet.communication_range):
            held = held_edges(self._case, self._case.ocp.motion(x)[0])
            upper[self._first_edge :] = np.where(held.T.ravel(), self._required.range**2, np.inf)
        return lower, upper

    def hessian(self, *, upper_triangle: bool) -> Any:
        """Return the Hessian of the Lagrangian as CasADi's solvers take it: (x, p, lam_f, lam_g) -> H."""
        w, p = self.nlp["x"], self.nlp["p"]
        lam_f, lam_g = cs.MX.sym("lam_f"), cs.MX.sym("lam_g", self.nlp["g"].shape[0])
        dimension = self._case.ocp.fleet.dimension
        cost = soft_hessian(self._parts, p[0], p[1], self.half // dimension)
        rows, _ = cs.hessian(cs.dot(lam_g, self.nlp["g"]), w)
        full = lam_f * cs.diagcat(cost, cs.MX(self.half, self.half)) + rows
        name = "triu_hess_gamma_x_x" if upper_triangle else "hess_gamma_x_x"
        matrix = cs.triu(full) if upper_triangle else full
        return cs.Function("nlp_hess_l", [w, p, lam_f, lam_g], [matrix], ["x", "p", "lam_f", "lam_g"], [name])

    def _add(self, expression: Any, lower: float, upper: float) -> None:
        column = cs.vec(expression)
        self._rows.append(column)
        self._bounds.append((np.full(column.shape[0], lower), np.full(column.shape[0], upper)))

    def _add_motion(self, w: Any) -> None:
        """Add dynamics (4.23), a closed end (3.15), and the discs of speed and input (4.13, 4.14)."""
        ocp, fleet = self._case.ocp, self._case.ocp.fleet
        agents, dimension = fleet.start.shape
        samples = ocp.steps + 1
        q = cs.reshape(w[: self.half], agents * dimension, samples)
        v = cs.reshape(w[self.half :], agents * dimension, samples)
        self._add(q[:, 1:] - q[:, :-1] - 0.5 * ocp.period * (v[:, :-1] + v[:, 1:]), 0.0, 0.0)
        if ocp.ends.closed:
            self._add(cs.vertcat(q[:, -1] - q[:, 0], v[:, -1] - v[:, 0]), 0.0, 0.0)
        u = (v[:, 1:] - v[:, :-1]) / ocp.period
        for agent in range(agents):
            own = slice(agent * dimension, (agent + 1) * dimension)
            self._add(cs.sum1(v[own, ocp.first :] ** 2), -np.inf, float(fleet.speed_max[agent]) ** 2)
            self._add(cs.sum1(u[own, :] ** 2), -np.inf, float(fleet.input_max[agent]) ** 2)
        if fleet.size > 1 and fleet.separation_min > 0.0:
            for square, apart in zip(self._squares(w), self._required.separation, strict=True):
                self._add(square, float(apart) ** 2, np.inf)

    def _add_pairs(self, w: Any) -> None:
        """Add the squared length of every pair; `row_bounds` says which are edges."""
        fleet = self._case.ocp.fleet
        if fleet.size > 1 and np.isfinite(fleet.communication_range):
            for square in self._squares(w):
                self._add(square, -np.inf, np.inf)

    def _squares(self, w: Any) -> list[Any]:
        """Return the squared distance of each pair at the samples that are not given."""
        ocp = self._case.ocp
        agents, dimension = ocp.fleet.start.shape
        q = cs.reshape(w[: self.half], agents * dimension, ocp.steps + 1)[:, ocp.first :]
        one, two = all_pairs(agents)
        return [
            cs.sum1((q[i * dimension : (i + 1) * dimension, :] - q[j * dimension : (j + 1) * dimension, :]) ** 2)
            for i, j in zip(one.tolist(), two.tolist(), strict=True)
        ]

    def _variable_bounds(self) -> tuple[FloatArray, FloatArray]:
        ocp, ends = self._case.ocp, self._case.ocp.ends
        fleet, shape = ocp.fleet, (2, ocp.steps + 1, *ocp.fleet.start.shape)
        lower, upper = np.full(shape, -np.inf), np.full(shape, np.inf)
        lower[0], upper[0] = fleet.motion_min, fleet.motion_max
        given = (
            ((0, 0), ends.start_position),
            ((1, 0), ends.start_velocity),
            ((0, -1), ends.end_position),
            ((1, -1), ends.end_velocity),
        )
        for where, value in given:
            if value is not None:
                lower[where] = upper[where] = value
        return lower.ravel(), upper.ravel()
