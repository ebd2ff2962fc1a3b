"""Agents without a controller on one bus in memory, before and after their start."""

from threading import Event

from mpc_cover.clock import VirtualClock
from mpc_cover.service.protocol.local import LocalBus
from mpc_cover.service.swarm.agent import SwarmAgent


class Ground:
    """Agents that wait on one bus; time passes tick by tick."""

    def __init__(self, mission, sign=None):
        """`sign`, where there is one, returns the transport of an agent that has keys."""
        self._sign = sign or (lambda name, transport: transport)
        self.mission, self.clock, self.said, self.agents = mission, VirtualClock(10.0), [], []
        self.bus = LocalBus(self.clock)

    def add(self, name, mission=None, **options):
        transport = self._sign(name, self.bus.join())
        agent = SwarmAgent(mission or self.mission, name, transport, self.clock, say=self.said.append, **options)
        agent.startup()
        self.agents.append(agent)
        return agent

    def wait(self, seconds):
        until = self.clock.now() + seconds
        while flying := [agent for agent in self.agents if not agent.done]:
            due = min(flying, key=lambda agent: agent.next_time)
            if due.next_time > until:
                break
            self.clock.wait_until(due.next_time, Event())
            due.tick()
        self.clock.wait_until(until, Event())

    def heard(self, text):
        return any(text in said for said in self.said)
