"""An anytime search for a complete motion of a given length, a hop at a time, that goes on where it was."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.planning.basin_hopping import Pool, hop
from mpc_cover.planning.scp import optimise

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray
    from mpc_cover.planning.budget import Budget
    from mpc_cover.planning.ocp import OCP
    from solvers.backends.base import Backend


class Shortening:
    """A descent from a guess that is too fast, then hops from the best minima until one is complete.

    Parameters
    ----------
    ocp, x : the OCP of the length wanted, and the guess, a decision vector.
    backend : descends.
    seed : of the hops.
    """

    def __init__(self, ocp: OCP, x: FloatArray, backend: Backend, seed: int = 0) -> None:
        self._ocp, self._x, self._backend = ocp, x, backend
        self._rng = np.random.default_rng(seed)
        self._pool = Pool(ocp)

    def hop(self, budget: Budget) -> FloatArray | None:
        """Descend once more; return the velocities (N+1, m, d) [m/s] of a complete motion, or None."""
        if self._pool.empty:
            found = optimise(self._ocp, self._x, self._backend, budget=budget)
        else:
            found = hop(self._ocp, self._pool.drawn(self._rng), self._backend, self._rng, budget=budget)
        self._pool.add(found)
        return self._ocp.motion(found.x)[1] if found.complete else None
