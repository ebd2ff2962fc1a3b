"""A small mission and a simple brain: sweeps in straight lines, no optimisation, exact on the grid."""

from dataclasses import dataclass
from enum import Enum, auto

import numpy as np

from mpc_cover.arrays import FloatArray
from mpc_cover.information.coverage_map import CoverageMap
from mpc_cover.mission.load import Mission, build_mission
from mpc_cover.model.motion import roll_out
from mpc_cover.planning.plan import Plan


class FakeRung(Enum):
    NEW = auto()
    BRAKE = auto()


@dataclass(frozen=True)
class FakeResult:
    plan: Plan
    rung: Enum = FakeRung.NEW
    reason: str = ""
    computing_time_s: float = 0.001
    deadline_missed: bool = False


def small_mission(**control) -> Mission:
    """Two agents side by side below a 3 m x 4 m area that one sweep upwards covers."""
    raw = {
        "schema": 1,
        "name": "small",
        "area": {"shape": {"kind": "box", "min_m": [0.0, 0.0], "max_m": [3.0, 4.0]}, "cell_size_m": 0.5},
        "fleet": {
            "defaults": {"sensing_radius_m": 1.0, "input_max_m_per_s2": 1.0, "speed_max_m_per_s": 1.0},
            "agents": [{"id": "a1", "start_m": [0.75, 0.5]}, {"id": "a2", "start_m": [2.25, 0.5]}],
            "separation_min_m": 0.5,
            "communication_range_m": 3.0,
        },
        "control": {"period_s": 0.5, "horizon_steps": 8, "planning_time_s": 1.0, **control},
    }
    return build_mission(raw, "small")


class SweepBrain:
    """Goes straight up to y = 3.5 m from wherever it is, then rests; brakes when told to something odd."""

    goal_y = 3.5

    def __init__(self, mission: Mission) -> None:
        self.mission = mission
        self.coverage = CoverageMap(mission)
        self.calls: list[tuple[str, float, float | None]] = []
        self.predicted: list[tuple[FloatArray, FloatArray]] = []
        self.raises: Exception | None = None

    def prepare(self, position, velocity, start_time, *, deadline):
        return self._plan("prepare", position, velocity, start_time, deadline)

    def step(self, position, velocity, start_time, *, deadline):
        self.predicted.append((position.copy(), velocity.copy()))
        return self._plan("step", position, velocity, start_time, deadline)

    def _plan(self, kind, position, velocity, start_time, deadline):
        self.calls.append((kind, start_time, deadline))
        if self.raises:
            raise self.raises
        steps, period = self.mission.spec.control.horizon_steps, self.mission.spec.control.period_s
        force = np.stack([self._climb(q, v, steps, period) for q, v in zip(position, velocity, strict=True)], axis=1)
        positions, velocities = roll_out(position, velocity, force, period)
        return FakeResult(Plan(start_time, period, positions, velocities, force))

    def _climb(self, position, velocity, steps, period):
        """Accelerate for `up` steps, coast, then brake: the first of few such profiles that does not overshoot."""
        rest = np.zeros((steps, len(position)))
        if self.coverage.complete and np.abs(velocity).max() < 1e-12:
            return rest
        for up in (2, 1, 0):
            for coast in range(steps, -1, -1):
                profile = self._profile(position, velocity, up, coast, steps, period)
                if profile is not None:
                    return profile
        return rest

    def _profile(self, position, velocity, up, coast, steps, period):
        peak = velocity + np.array([0.0, 0.4 * up])
        if np.linalg.norm(peak) > 1.0 + 1e-9:
            return None
        down = int(np.ceil(np.linalg.norm(peak) / (0.9 * period) - 1e-9))
        if up + coast + down > steps:
            return None
        force = np.zeros((steps, len(position)))
        force[:up] = np.array([0.0, 0.4 / period])
        if down:
            force[up + coast : up + coast + down] = -peak / (down * period)
        q, _ = roll_out(position[None], velocity[None], force[:, None], period)
        return force if q[:, 0, 1].max() <= self.goal_y + 1e-9 else None
