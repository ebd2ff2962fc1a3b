"""The record of a simulation of the distributed law: the data of its figures and tables."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.verification.connectivity import widest_bottleneck
from mpc_cover.verification.path import Path
from mpc_cover.verification.separation import smallest_separation

if TYPE_CHECKING:
    from mpc_cover.arrays import BoolArray, FloatArray
    from mpc_cover.mission.field import Field
    from mpc_cover.mission.fleet import Fleet
    from mpc_cover.studies.swarm_parameters import SwarmParameters


@dataclass(frozen=True, eq=False)
class MapRecord:
    """Maps at S moments.

    Attributes
    ----------
    time : (S,) [s].
    true : (S, K) gamma of the fleet's looks, summed over magnitudes.
    own : (S, m, K) gamma that each agent knew of.
    estimate : (S, m, K) each agent's estimate of the first magnitude's field; empty (S, m, 0) without one.
    """

    time: FloatArray
    true: FloatArray
    own: FloatArray
    estimate: FloatArray


@dataclass(frozen=True, eq=False)
class SwarmRecord:
    """A run of T samples.

    Attributes
    ----------
    parameters, seed : of the simulation.
    fleet, field : the agents, and the cells.
    time : (T,) [s].
    position, velocity : (T, m, d) [m], [m/s]; a single integrator's velocity is that of the interval that follows.
    input : (T-1, m, d) [m/s^2] held over each interval; zero for single integrators.
    residual : (T,) gamma of all cells, as a part of what it was before the first look.
    own_residual : (T, m) the same as each agent knew it.
    kept : (T, m, m) edges that agent i (row) keeps in the interval that follows.
    covered_at : (K,) [s]; inf where never, and throughout for ageing maps.
    worst_age, mean_age : (T,) [s]; empty but for ageing maps.
    truth : (K,) the field that is estimated; empty without one.
    maps : at some samples.
    """

    parameters: SwarmParameters
    seed: int
    fleet: Fleet
    field: Field
    time: FloatArray
    position: FloatArray
    velocity: FloatArray
    input: FloatArray
    residual: FloatArray
    own_residual: FloatArray
    kept: BoolArray
    covered_at: FloatArray
    worst_age: FloatArray
    mean_age: FloatArray
    truth: FloatArray
    maps: MapRecord

    @property
    def path(self) -> Path:
        """The continuous path, for the verifier's exact distances."""
        return Path(self.time, self.position, self.velocity, self.input)

    @property
    def covered(self) -> bool:
        """Whether everything was measured."""
        return bool(np.isfinite(self.covered_at).all())

    @property
    def time_to_cover(self) -> float:
        """When the last cell was settled [s]; inf for never."""
        return float(self.covered_at.max())

    @property
    def time_to_know(self) -> float:
        """When the last agent knew that everything was measured [s]; inf for never."""
        known = (self.own_residual == 0.0).all(axis=1)
        return float(self.time[int(np.argmax(known))]) if known.any() else np.inf

    def time_to(self, part: float) -> float:
        """Return when `part` (0 to 1) of the cells was settled [s]; inf for never."""
        needed = max(1, int(np.ceil(part * self.covered_at.size - 1e-9)))
        return float(np.sort(self.covered_at)[needed - 1])

    @property
    def closest(self) -> float:
        """Smallest distance of two agents at any instant [m]; inf for one agent."""
        found = smallest_separation(self.path)
        return np.inf if found is None else found.value

    @property
    def bottleneck(self) -> float:
        """Least range that connects the fleet at every instant [m]; 0 for one agent."""
        found = widest_bottleneck(self.path, limit=self.fleet.communication_range)
        return 0.0 if found is None else found.value

    @property
    def distance(self) -> FloatArray:
        """(m,) [m] travelled, by the samples."""
        return np.asarray(np.linalg.norm(np.diff(self.position, axis=0), axis=2).sum(axis=0))
