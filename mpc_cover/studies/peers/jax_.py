"""JAX and SciPy's L-BFGS-B: all constraints as quadratic penalties, the formulation of differentiable programming.

Variables are the velocities, and the start where that is free: dynamics and ends hold exactly, as `OCP.exact_ends` is
an affine map. The rest, discs of speed and input, the box, separation and edges, costs the square of its relative
violation. Sharpness of the soft minimum and weight of the penalties rise together, stage by stage; spanning trees are
chosen anew before each stage. Compiling counts as setting up.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import jax
import jax.numpy as jnp
import numpy as np
from scipy.optimize import minimize

from mpc_cover.constraints.pairs import all_pairs
from mpc_cover.planning.ocp import Margins
from mpc_cover.planning.scp import SHARPNESS, length_scale, softness_at
from mpc_cover.studies.case import asked_of_peers, held_edges
from mpc_cover.studies.watch import Enough

if TYPE_CHECKING:
    from mpc_cover.arrays import BoolArray, FloatArray
    from mpc_cover.studies.case import Case
    from mpc_cover.studies.watch import Answer, Watch

ITERATIONS, LONG = 400, 5000
"""Bounds on the iterations of all stages but the last, and of the last. On box-3 200 and 1000 were no better."""
MEMORY = 20
"""Pairs that L-BFGS-B keeps; a plain choice."""
PENALTY = 4.0
"""Weight of the squared relative violations, times the square of the sharpness, in sensing radii of J. Ten times as
much ended at 98 % of box-3 from both guesses, this at 100 %."""
_ROUND = 1e-8
"""Added to squared distances, in squared sensing radii: the norm has no gradient at 0."""


def penalised(case: Case, x: FloatArray, watch: Watch) -> Answer:
    """Solve with log-sum-exp for the minimum, sharpness and penalties raised in stages."""
    form = Penalised(case)
    stages = [(sharpness, softness_at(sharpness, form.scale)) for sharpness in SHARPNESS]
    edges, (sharpness, softness) = form.edges(x), stages[0]
    form.value_and_gradient(x, softness.beta, softness.margin, sharpness, edges)  # compiles
    iterations, status = 0, "nothing to do"

    def shown(xk: FloatArray) -> None:
        nonlocal x, iterations
        iterations, x = iterations + 1, case.ocp.exact_ends(xk)
        if watch.see(x):
            raise Enough

    watch.begin(x)
    for number, (sharpness, softness) in enumerate(stages, start=1):
        if watch.enough:
            status = "everything is covered" if watch.complete else "time is up"
            break
        options: Any = {
            "bounds": form.bounds(),
            "options": {
                "maxiter": LONG if number == len(stages) else ITERATIONS,
                "maxcor": MEMORY,
                "maxfun": 10 * LONG,
            },
            "args": (softness.beta, softness.margin, sharpness, form.edges(x)),
        }
        try:
            result = minimize(form.value_and_gradient, x, jac=True, method="L-BFGS-B", callback=shown, **options)
        except Enough:
            status = "everything is covered" if watch.complete else "time is up"
            break
        x, status = case.ocp.exact_ends(result.x), str(result.message)
    return watch.answer(x, iterations, status)


class Penalised:
    """One case as a smooth function of its decision vector, without constraints; in sensing radii.

    Attributes
    ----------
    scale : the length that all are relative to [m].

    Raises
    ------
    NotImplementedError
        Cells are owed several looks.
    """

    def __init__(self, case: Case) -> None:
        jax.config.update("jax_enable_x64", True)  # float32 ends at violations of 1e-3
        self._case, ocp = case, case.ocp
        if ocp.looks is not None:
            raise NotImplementedError("a cost of several looks at a cell is not written for JAX")
        self.scale = length_scale(ocp)
        size = (ocp.steps + 2) * ocp.fleet.start.size
        self._offset = ocp.exact_ends(np.zeros(size))
        self._to_x = np.stack([ocp.exact_ends(each) for each in np.eye(size)], axis=1) - self._offset[:, None]
        self._cells = [self._cells_of(magnitude) for magnitude in range(ocp.fleet.radius.shape[1])]
        self._compiled = jax.jit(jax.value_and_grad(self._value))

    def value_and_gradient(
        self, x: FloatArray, beta: float, margin: float, sharpness: float, edges: BoolArray
    ) -> tuple[float, FloatArray]:
        """Return J_beta (soft minimum over all samples) with penalties, and its gradient (n,).

        Parameters
        ----------
        x : decision vector, whose ends are made exact.
        beta, margin : of the soft minimum [1/m], [m].
        sharpness : beta in sensing radii, whose square weighs the penalties.
        edges : (samples, pairs) that are to keep within range.
        """
        value, gradient = self._compiled(x, beta, margin, sharpness, edges)
        return float(value), np.asarray(gradient, dtype=float)

    def edges(self, x: FloatArray) -> BoolArray:
        """Return the edges that a motion is held by, see `case.held_edges`."""
        return held_edges(self._case, self._case.ocp.motion(x)[0])

    def bounds(self) -> list[tuple[float, float]]:
        """Return the bounds of L-BFGS-B: those of the motion box for the start, of each velocity's components."""
        fleet, steps = self._case.ocp.fleet, self._case.ocp.steps
        start = np.stack(np.broadcast_arrays(fleet.motion_min, fleet.motion_max, fleet.start)[:2], axis=-1)
        fastest = np.broadcast_to(fleet.speed_max[:, None], fleet.start.shape).ravel()
        velocity = np.tile(np.stack([-fastest, fastest], axis=-1), (steps + 1, 1))
        return [(float(low), float(high)) for low, high in (*start.reshape(-1, 2), *velocity)]

    def _value(self, x: Any, beta: Any, margin: Any, sharpness: Any, edges: Any) -> Any:
        position, velocity = self._motion(self._to_x @ x + self._offset)
        cost = sum(self._coverage(position, cells, beta, margin) for cells in self._cells)
        weight = PENALTY * sharpness**2
        return cost / self.scale + weight * self._violations(position, velocity, edges)

    def _motion(self, x: Any) -> tuple[Any, Any]:
        """Return positions and velocities (N+1, m, d) of a decision vector: `OCP.motion` for JAX."""
        ocp = self._case.ocp
        shape, size = ocp.fleet.start.shape, ocp.fleet.start.size
        start, velocity = x[:size].reshape(shape), x[size:].reshape(ocp.steps + 1, *shape)
        moved = 0.5 * ocp.period * jnp.cumsum(velocity[:-1] + velocity[1:], axis=0)
        return jnp.concatenate([start[None], start + moved]), velocity

    def _cells_of(self, magnitude: int) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Return the cells that a magnitude is owed at, their weights, who can measure it, and with which radii."""
        fleet, weight = self._case.ocp.fleet, self._case.ocp.weight[magnitude]
        able = np.flatnonzero(np.isfinite(fleet.radius[:, magnitude]))
        live = weight > 0.0
        return self._case.ocp.cell[live], weight[live], able.astype(float), fleet.radius[able, magnitude]

    def _coverage(self, position: Any, cells: Any, beta: Any, margin: Any) -> Any:
        """Return one magnitude's J_beta [m]: log-sum-exp for the minimum, softplus for pos."""
        cell, weight, able, radius = cells
        points = position[:, able.astype(int)].reshape(-1, cell.shape[1])
        square = jnp.sum((points[None] - cell[:, None]) ** 2, axis=2)
        excess = jnp.sqrt(square + _ROUND * self.scale**2) - jnp.tile(radius, position.shape[0])
        level = -jax.nn.logsumexp(-beta * excess, axis=1) / beta + margin
        return weight @ (jax.nn.softplus(beta * level) / beta)

    def _violations(self, position: Any, velocity: Any, edges: Any) -> Any:
        """Return the sum of the squared relative violations of everything but dynamics and ends."""
        ocp, fleet, share = self._case.ocp, self._case.ocp.fleet, Margins().limit_share
        required = asked_of_peers(self._case)
        speed = self._length(velocity) / (share * fleet.speed_max)
        force = self._length(jnp.diff(velocity, axis=0) / ocp.period) / (share * fleet.input_max)
        outside = jnp.maximum(fleet.motion_min - position, position - fleet.motion_max) / self.scale
        parts = [speed - 1.0, force - 1.0, outside]
        if fleet.size > 1:
            one, two = all_pairs(fleet.size)
            apart = self._length(position[ocp.first :, one] - position[ocp.first :, two])
            if fleet.separation_min > 0.0:
                parts.append(1.0 - apart / required.separation)
            if np.isfinite(required.range):
                parts.append(jnp.where(edges, apart / required.range - 1.0, 0.0))
        return sum(jnp.sum(jnp.maximum(part, 0.0) ** 2) for part in parts)

    def _length(self, vectors: Any) -> Any:
        return jnp.sqrt(jnp.sum(vectors**2, axis=-1) + _ROUND * self.scale**2)
