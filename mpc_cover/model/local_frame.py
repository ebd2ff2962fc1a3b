"""The local frame: coordinates from a corner of W in units of a sensing radius.

Plans are computed in it, so that they do not depend on where a mission lies nor on how large it is: a mission that is
moved, or whose lengths, speeds and accelerations are all multiplied by a factor, is the same mission in its local
frame, up to rounding. There every tolerance, margin and weight of planning is relative to a sensing radius, and no
coordinate is larger than W requires, whatever the distance to the origin (UTM coordinates have seven digits before the
point).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.mission.load import Mission
from mpc_cover.model.trajectory import Trajectory

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray
    from mpc_cover.mission.config import MissionSpec
    from mpc_cover.mission.field import Field
    from mpc_cover.mission.fleet import Fleet
    from mpc_cover.model.fleet_state import FleetState

_GRID = 1e-9
"""Coordinates of a mission are rounded to multiples of this in the local frame [sensing radii], far below anything that
matters: else ties between plans would be broken by the rounding of coordinates far from the origin."""


@dataclass(frozen=True, eq=False)
class LocalFrame:
    """An origin and a unit of length; times keep their unit.

    Attributes
    ----------
    origin : (d,) [m]: the lower corner of W's bounding box.
    length : [m]: the smallest sensing radius.
    grid : to which the mission's coordinates are rounded [local units].
    """

    origin: FloatArray
    length: float
    grid: float

    @classmethod
    def of(cls, mission: Mission) -> LocalFrame:
        """Return the local frame of a mission."""
        origin, length = mission.field.shape_min, mission.fleet.sensing_radius_min
        farthest = np.abs(np.concatenate([mission.field.shape_max, mission.fleet.start.ravel(), origin])).max()
        resolved = 4.0 * float(np.spacing(farthest)) / length
        return cls(origin, length, max(_GRID, 10.0 ** np.ceil(np.log10(resolved))))

    def position(self, position: FloatArray) -> FloatArray:
        """Return positions (..., d) [m] in local units."""
        return self._rounded((position - self.origin) / self.length)

    def vector(self, vector: FloatArray) -> FloatArray:
        """Return velocities or accelerations [m/s], [m/s^2] in local units."""
        return self._rounded(vector / self.length)

    def mission(self, mission: Mission) -> Mission:
        """Return a mission with cells, fleet and disturbances in local units; the rest of its spec is as before."""
        return Mission(self._spec(mission.spec), self._field(mission.field), self.fleet(mission.fleet))

    def state(self, state: FleetState) -> FleetState:
        """Return a state of the fleet in local units."""
        obstacles = {index: self.local(motion) for index, motion in state.obstacles.items()}
        here, moving = self.position(state.position), self.vector(state.velocity)
        held = {index: [self.local(motion) for motion in motions] for index, motions in state.held.items()}
        return replace(state, position=here, velocity=moving, obstacles=obstacles, held=held)

    def local(self, motion: Trajectory) -> Trajectory:
        """Return a motion [m] in local units."""
        return Trajectory(
            motion.time,
            (motion.position - self.origin) / self.length,
            motion.velocity / self.length,
            motion.input / self.length,
            motion.period,
        )

    def metric(
        self, motion: Trajectory, position: FloatArray | None = None, velocity: FloatArray | None = None
    ) -> Trajectory:
        """Return a motion in local units as one in metres, from its own initial state or from a given one (m, d).

        A given state [m], [m/s] differs from the motion's by rounding only; the dynamics hold from it on exactly.
        """
        if position is None:
            position = self.origin + self.length * motion.position[0]
        if velocity is None:
            velocity = self.length * motion.velocity[0]
        later = self.length * motion.velocity[1:]
        return Trajectory.from_velocities(position, velocity, later, motion.start_time, motion.period)

    def fleet(self, fleet: Fleet) -> Fleet:
        """Return the specification of a fleet in local units."""
        unit = self.length
        return replace(
            fleet,
            start=self.position(fleet.start),
            input_max=self._rounded(fleet.input_max / unit),
            speed_max=self._rounded(fleet.speed_max / unit),
            radius=self._rounded(fleet.radius / unit),
            separation_min=float(self._rounded(fleet.separation_min / unit)),
            communication_range=float(self._rounded(fleet.communication_range / unit)),
            motion_min=self.position(fleet.motion_min),
            motion_max=self.position(fleet.motion_max),
        )

    def _field(self, field: Field) -> Field:
        return replace(
            field,
            cell=self.position(field.cell),
            cell_size=float(self._rounded(field.cell_size / self.length)),
            shape_min=self.position(field.shape_min),
            shape_max=self.position(field.shape_max),
        )

    def _spec(self, spec: MissionSpec) -> MissionSpec:
        """Return the spec with its disturbances in local units; planning reads no other length from it."""
        given, unit = spec.disturbance, self.length
        local = given.model_copy(
            update={
                "position_noise_m": given.position_noise_m / unit,
                "input_noise_m_per_s2": given.input_noise_m_per_s2 / unit,
                "wind_m_per_s2": tuple(part / unit for part in given.wind_m_per_s2),
            }
        )
        return spec.model_copy(update={"disturbance": local})

    def _rounded(self, value: FloatArray | float) -> FloatArray:
        """Return values on the grid; infinite ones, of what is not asked for or not measured, stay so."""
        return np.asarray(self.grid * np.round(value / self.grid))
