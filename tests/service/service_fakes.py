"""A small mission and a simple brain: sweeps in straight lines, no optimisation, exact on the grid."""

import time
from dataclasses import dataclass
from enum import Enum, auto
from threading import Event

import numpy as np

from mpc_cover.clock import VirtualClock
from mpc_cover.information.coverage_map import CoverageMap
from mpc_cover.mission.load import Mission, build_mission
from mpc_cover.model.motion import roll_out
from mpc_cover.model.trajectory import Trajectory
from mpc_cover.service.agent.agent import Agent
from mpc_cover.service.agent.recorder import MemoryRecorder
from mpc_cover.service.agent.schedule import predict
from mpc_cover.service.controller.controller import Controller
from mpc_cover.service.protocol.decoding import decode_event, decode_state
from mpc_cover.service.protocol.keys import Keys
from mpc_cover.service.protocol.local import LocalBus
from mpc_cover.service.protocol.messages import PlanMessage


class FakeRung(Enum):
    NEW = auto()
    BRAKE = auto()


@dataclass(frozen=True)
class FakeResult:
    plan: Trajectory
    plan_source: Enum = FakeRung.NEW
    reason: str = ""
    computing_time_s: float = 0.001
    deadline_missed: bool = False


def small_mission(height=4.0, *, disturbance=None, reach=3.0, **control) -> Mission:
    """Two agents side by side at the lower edge of an area 3 m wide that one sweep upwards covers."""
    raw = {
        "schema": 1,
        "name": "small",
        "area": {"shape": {"kind": "box", "min_m": [0.0, 0.0], "max_m": [3.0, height]}, "cell_size_m": 0.5},
        "fleet": {
            "defaults": {"sensing_radius_m": 1.0, "input_max_m_per_s2": 1.0, "speed_max_m_per_s": 1.0},
            "agents": [{"id": "a1", "start_m": [0.75, 0.5]}, {"id": "a2", "start_m": [2.25, 0.5]}],
            "separation_min_m": 0.5,
            "communication_range_m": reach,
        },
        "control": {"period_s": 0.5, "horizon_steps": 8, "planning_time_s": 1.0, **control},
        "disturbance": disturbance or {},
    }
    return build_mission(raw, "small")


class SweepLaw:
    """Goes straight up to `goal_y` [m] from wherever it is, then down again should anything be owed."""

    def __init__(self, mission: Mission, goal_y: float = 3.5) -> None:
        self.mission = mission
        self.goal_y = goal_y
        self.up = True
        self.coverage = CoverageMap(mission)
        self.calls: list[tuple[str, float, float | None]] = []
        self.predicted: list[tuple[np.ndarray, np.ndarray]] = []
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
        if not velocity.any() and not self._climb(position[0], velocity[0], 8, 0.5).any():
            self.up = not self.up
        steps, period = self.mission.spec.control.horizon_steps, self.mission.spec.control.period_s
        force = np.stack([self._climb(q, v, steps, period) for q, v in zip(position, velocity, strict=True)], axis=1)
        positions, velocities = roll_out(position, velocity, force, period)
        return FakeResult(Trajectory.even(start_time, period, positions, velocities, force))

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
        sign = 1.0 if self.up else -1.0
        peak = velocity + np.array([0.0, 0.4 * up * sign])
        if np.linalg.norm(peak) > 1.0 + 1e-9:
            return None
        down = int(np.ceil(np.linalg.norm(peak) / (0.9 * period) - 1e-9))
        if up + coast + down > steps:
            return None
        force = np.zeros((steps, len(position)))
        force[:up] = np.array([0.0, 0.4 * sign / period])
        if down:
            force[up + coast : up + coast + down] = -peak / (down * period)
        q, _ = roll_out(position[None], velocity[None], force[:, None], period)
        inside = q[:, 0, 1].min() >= 0.5 - 1e-9 and q[:, 0, 1].max() <= self.goal_y + 1e-9
        return force if inside else None


class SharingBrain(SweepLaw):
    """A sweep that is told who is lost and who is slow; plans for the lost are never sent."""

    def __init__(self, mission: Mission, goal_y: float = 3.5) -> None:
        super().__init__(mission, goal_y)
        self.lost: list[list[bool]] = []
        self.parts: list[tuple[int, float]] = []

    def set_lost(self, lost):
        self.lost.append(lost.tolist())

    def limit_speed(self, index, part):
        self.parts.append((index, part))


class Bench:
    """A clock, a bus, and ticks of whoever takes part, each when it is due."""

    def __init__(self, mission: Mission, channel=None) -> None:
        self.mission = mission
        self.clock = VirtualClock(100.0)
        self.bus = LocalBus(self.clock, channel)
        self.keys = Keys(mission.spec.name)
        self.agents: list[Agent] = []
        self.transports = {}
        self.records: dict[str, MemoryRecorder] = {}
        self.said: list[str] = []
        self._ears = {}
        self._never = Event()

    def agent(self, name="a1", *, instance=None, clock=None, seed=0) -> Agent:
        self.records[name] = MemoryRecorder()
        self.transports[name] = self.bus.join()
        agent = Agent(
            self.mission,
            name,
            self.transports[name],
            clock or self.clock,
            instance=instance or f"{name}-life",
            seed=seed,
            recorder=self.records[name],
            say=self.said.append,
        )
        agent.startup()
        self.agents.append(agent)
        return agent

    def kill(self, agent: Agent) -> None:
        """End an agent as SIGKILL would: its token goes, and nothing more comes."""
        self.agents.remove(agent)
        self.transports[agent.id].close()

    def controller(self, law, **options) -> Controller:
        options = {"deadlines": False, "say": self.said.append, **options}
        controller = Controller(self.mission, law, self.bus.join(), self.clock, **options)
        controller.startup()
        return controller

    def hear(self, pattern: str):
        """Return an inbox on a pattern, always the same one."""
        if pattern not in self._ears:
            self._ears[pattern] = self.bus.join().inbox(pattern, 10_000, history=1000)
        return self._ears[pattern]

    def states(self, name="a1"):
        return [decode_state(item.payload, 2) for item in self.hear(self.keys.state(name)).drain()]

    def events(self):
        items = [*self.hear(self.keys.controller_event).drain(), *self.hear(self.keys.agent_event()).drain()]
        return [decode_event(item.payload) for item in items]

    def run(self, *controllers, until=None, seconds=60.0, after=None) -> None:
        """Tick in the order in which ticks are due, agents first, until `until()` holds or time is up."""
        end = self.clock.now() + seconds
        while True:
            participants = [*self.agents, *controllers]
            due = min(participants, key=lambda participant: participant.next_time)
            if due.next_time > end + 1e-9 or (until and until()):
                return
            self.clock.wait_until(due.next_time, self._never)
            due.tick()
            if after:
                after(due)


def straight_plan(agent: Agent, start_s: float, /, *, seq=0, epoch=1, controller="c", steps=8, period=0.5, **changes):
    """Return a plan that an agent at rest at `start_s` can fly: a metre or so upwards, and rest."""
    q, v = predict(agent.plant, agent.schedule, start_s)
    force = np.zeros((steps, 1, 2))
    force[0, 0, 1] = 0.8
    force[2:4, 0] = -(v + period * force[0, 0]) / (2 * period)
    position, velocity = roll_out(q[None], v[None], force, period)
    fields = {
        "epoch": epoch,
        "controller": controller,
        "seq": seq,
        "agent": agent.id,
        "instance": agent.instance,
        "start_s": start_s,
        "valid_until_s": start_s + period,
        "period_s": period,
        "position": position[:, 0].tolist(),
        "velocity": velocity[:, 0].tolist(),
        "input": force[:, 0].tolist(),
    }
    return PlanMessage(**{**fields, **changes})


def until(condition, seconds=20.0, every=0.01):
    """Wait for a condition that another process or thread brings about; return what it returned."""
    deadline, waiting = time.monotonic() + seconds, Event()
    while not (result := condition()):
        assert time.monotonic() < deadline, "it did not come about"
        waiting.wait(every)
    return result
