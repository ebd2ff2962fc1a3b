"""A small mission, and a bench on which agents and controllers are ticked on a virtual clock."""

import time
from threading import Event

import numpy as np

from mpc_cover.clock import VirtualClock
from mpc_cover.mission.load import Mission, build_mission
from mpc_cover.model.motion import roll_out
from mpc_cover.planning.budget import Budget
from mpc_cover.service.agent.agent import Agent
from mpc_cover.service.agent.recorder import MemoryRecorder
from mpc_cover.service.agent.schedule import predict
from mpc_cover.service.controller.controller import Controller
from mpc_cover.service.protocol.decoding import decode_event, decode_plan, decode_state, decode_status
from mpc_cover.service.protocol.keys import Keys
from mpc_cover.service.protocol.local import LocalBus
from mpc_cover.service.protocol.messages import PlanMessage


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


class Bench:
    """A clock, a bus, and ticks of whoever takes part, each when it is due."""

    def __init__(self, mission: Mission, channel=None, sign=None) -> None:
        """`sign`, where there is one, returns the transport of a role that has keys."""
        self.mission = mission
        self._sign = sign or (lambda role, transport: transport)
        self.clock = VirtualClock(100.0)
        self.bus = LocalBus(self.clock, channel)
        self.keys = Keys(mission.spec.name)
        self.agents: list[Agent] = []
        self.transports = {}
        self.records: dict[str, MemoryRecorder] = {}
        self.said: list[str] = []
        self._ears = {}
        self._never = Event()
        for pattern in (self.keys.status, *map(self.keys.plan, mission.fleet.ids)):
            self.hear(pattern)  # from the beginning

    def agent(self, name="a1", *, mission=None, instance=None, clock=None, seed=0, place=None) -> Agent:
        self.records[name] = MemoryRecorder()
        self.transports[name] = self.bus.join()
        agent = Agent(
            mission or self.mission,
            name,
            self._sign(name, self.transports[name]),
            clock or self.clock,
            instance=instance or f"{name}-life",
            seed=seed,
            recorder=self.records[name],
            say=self.said.append,
            place=place,
        )
        agent.startup()
        self.agents.append(agent)
        return agent

    def kill(self, agent: Agent) -> None:
        """End an agent as SIGKILL would: its token goes, and nothing more comes."""
        self.agents.remove(agent)
        self.transports[agent.id].close()

    def controller(self, law, **options) -> Controller:
        options = {"budget_of": Budget.counted, "say": self.said.append, **options}
        transport = self._sign("controller", self.bus.join())
        controller = Controller(self.mission, law, transport, self.clock, **options)
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

    def plans(self, name="a1"):
        """Return the plans sent to an agent since last asked, decoded: each is one that the agent could read."""
        return [decode_plan(item.payload, 2) for item in self.hear(self.keys.plan(name)).drain()]

    def statuses(self):
        return [decode_status(item.payload) for item in self.hear(self.keys.status).drain()]

    def wait_until(self, time_s: float) -> None:
        """Let time pass without a tick of anyone: all are stopped."""
        self.clock.wait_until(time_s, self._never)

    def run(self, *controllers, until=None, seconds=60.0, after=None) -> None:
        """Tick in the order in which ticks are due, agents first, until `until()` holds or time is up."""
        end = self.clock.now() + seconds
        while True:
            participants = [*self.agents, *controllers]
            due = min(participants, key=lambda participant: participant.next_time)
            if due.next_time > end + 1e-9 or (until and until()):
                return
            self.wait_until(due.next_time)
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


class CheckpointsInMemory:
    """Keeps the newest snapshot; `problem` is what goes wrong with each, if anything."""

    def __init__(self, problem=None):
        self.kept = None
        self._problem = problem

    def save(self, snapshot, *, now):
        self.kept = snapshot
        return self._problem

    def close(self):
        pass
