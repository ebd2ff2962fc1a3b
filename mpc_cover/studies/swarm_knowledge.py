"""The maps of a simulated fleet: of all measurements, and of those that each agent knows (5.2.1.1, 6.3)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.information.ageing import AgeingMap
from mpc_cover.information.delay import FixedDelay, RelayDelay, adjacency
from mpc_cover.information.delayed_map import DelayedMaps
from mpc_cover.information.effective import k_coverage
from mpc_cover.information.kalman import KalmanMap
from mpc_cover.information.scalar_field import NoisySensing, bumpy_field
from mpc_cover.information.visibility import Visibility
from mpc_cover.studies.swarm_parameters import AgeingInformation, KalmanInformation, LookInformation

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray
    from mpc_cover.information.looks import Sensing
    from mpc_cover.information.residual_map import ResidualMap
    from mpc_cover.mission.field import Field
    from mpc_cover.mission.fleet import Fleet
    from mpc_cover.studies.swarm_parameters import Information, SwarmParameters


def make_map(information: Information, sensing: Sensing) -> ResidualMap | AgeingMap:
    """Return an empty map of the kind asked for."""
    match information:
        case LookInformation(looks=looks):
            return k_coverage(sensing, looks)
        case KalmanInformation(variance=variance, noise=noise, enough=enough):
            return KalmanMap(sensing, variance=variance, noise=noise, enough=enough)
        case AgeingInformation(fresh_s=fresh):
            return AgeingMap(sensing, fresh)


class Knowledge:
    """The fleet's map and each agent's own; without delay they are the same.

    Attributes
    ----------
    true : of all looks.
    own : (m,) of the looks that each agent has received.
    truth : (K,) the field to be estimated; empty without one.
    """

    def __init__(self, fleet: Fleet, field: Field, parameters: SwarmParameters, seed: int) -> None:
        self._sensing: Sensing = Visibility(field, fleet.radius)
        self._able = (fleet.radius > 0.0).astype(float)
        self._reach = fleet.communication_range
        self.truth: FloatArray = np.empty(0)
        information = parameters.information
        if isinstance(information, KalmanInformation):
            rng = np.random.default_rng([seed, 1])
            fields = np.array([bumpy_field(field.cell, rng, information.bumps) for _ in range(self._sensing.shape[0])])
            self.truth = fields[0]
            self._sensing = NoisySensing(self._sensing, fields, information.noise, np.random.default_rng([seed, 2]))
        self.true = make_map(information, self._sensing)
        self.own = (self.true,) * fleet.size
        self._delayed: DelayedMaps[ResidualMap | AgeingMap] | None = None
        if parameters.delay != 0:
            delay = RelayDelay(fleet.size) if parameters.delay == "hops" else FixedDelay(parameters.delay)
            self._delayed = DelayedMaps([make_map(information, self._sensing) for _ in fleet.ids], delay)
            self.own = self._delayed.maps
        self._begin = float(self.true.residual.sum())

    def observe(self, sample: int, time_s: float, position: FloatArray) -> None:
        """Take in what agents at (m, d) positions [m] measure at a sample, and pass on what is due."""
        looks = self._sensing.looks(time_s, position)
        self.true.take(looks)
        if self._delayed is not None:
            self._delayed.observe(sample, looks, adjacency(position, self._reach))
        for each in {id(each): each for each in (self.true, *self.own)}.values():
            if isinstance(each, AgeingMap):
                each.pass_time(time_s)

    def weights(self) -> FloatArray:
        """Return (m, K): gamma that each agent knows of, summed over the magnitudes that it can measure."""
        if self._delayed is None:
            return np.asarray(self._able @ self.true.residual)
        return np.array([able @ each.residual for able, each in zip(self._able, self.own, strict=True)])

    @property
    def settled(self) -> bool:
        """Whether every agent knows that nothing is owed, for good."""
        return all(not isinstance(each, AgeingMap) and each.complete for each in self.own)

    def left(self, each: ResidualMap | AgeingMap) -> float:
        """Return the residual information of a map as a part of the initial; of an ageing map, the part not fresh."""
        if isinstance(each, AgeingMap):
            return 1.0 - each.fraction
        return float(each.residual.sum()) / self._begin if self._begin > 0.0 else 0.0

    def estimates(self) -> FloatArray:
        """Return (m, K): each agent's estimate of the first magnitude's field; (m, 0) without one."""
        every = [each.estimate[0] if isinstance(each, KalmanMap) else np.empty(0) for each in self.own]
        return np.array(every)
