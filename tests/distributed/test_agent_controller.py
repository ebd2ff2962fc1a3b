"""Agents that run the law by themselves: they hear, relay, brake when unsure, and finish without the dead."""

from __future__ import annotations

import numpy as np
import pytest

from mpc_cover.distributed.agent_controller import AgentController
from mpc_cover.distributed.double_integrator_filter import stopping_balls
from mpc_cover.distributed.parameters import AgentParameters
from mpc_cover.distributed.potential_functions import Coordination
from mpc_cover.distributed.potential_law import LawParameters
from mpc_cover.information.delay import adjacency
from mpc_cover.information.effective import k_coverage
from mpc_cover.information.visibility import Visibility
from mpc_cover.studies.swarm_parameters import LookInformation, Scenario, SwarmParameters
from mpc_cover.verification.motion import verify_motion

PERIOD = 0.5


class Airspace:
    """Moves the agents and carries their messages to those in range, except those that get lost."""

    def __init__(self, seed, agents=5, size=6.0, loss=0.0, **parameters):
        self.rng = np.random.default_rng(seed)
        scenario = Scenario(
            SwarmParameters(LookInformation(1)),
            size_m=(size, size),
            agents=agents,
            speed_max_m_per_s=1.0,
            input_max_m_per_s2=1.5,
            separation_m=0.5,
            range_m=4.0,
        )
        self.fleet, self.field = scenario.build(np.random.default_rng([seed, 1]))
        self.loss, self.dead, self.deaf = loss, set(), set()
        sight = Visibility(self.field, self.fleet.radius)
        self.true = k_coverage(sight, 1)
        order = np.random.default_rng(9).permutation(self.field.size)
        self.agents = [
            AgentController(
                self.fleet,
                self.field,
                index,
                k_coverage(sight, 1),
                sight,
                coordination=Coordination(0.5, 1.0, 4.0, 3.0),
                parameters=AgentParameters(LawParameters(), PERIOD, **parameters),
                order=order,
                rng=np.random.default_rng([seed, 2, index]),
            )
            for index in range(agents)
        ]
        self.states, self.forces = [(self.fleet.start, np.zeros_like(self.fleet.start))], []

    def step(self):
        sample = len(self.forces)
        q, v = self.states[-1]
        self.true.observe(PERIOD * sample, np.where(self._living()[:, None], q, np.nan))
        hears = adjacency(q, self.fleet.communication_range)
        sent = {}
        for i, agent in enumerate(self.agents):
            if i not in self.dead:
                own = agent.report(sample, PERIOD * sample, q[i], v[i])
                sent[i] = [own, *agent.reports_to_relay()]
        for i, agent in enumerate(self.agents):
            for j, reports in sent.items():
                if hears[i, j] and i not in self.deaf and self.rng.random() >= self.loss:
                    agent.receive(reports)
        brake = stopping_balls(q, v, self.fleet.input_max, PERIOD).force
        force = brake.copy()
        for i, agent in enumerate(self.agents):
            if i in sent:
                force[i] = agent.decide(sent[i][0])
                for j in np.flatnonzero(hears[i]):
                    if j not in self.deaf and self.rng.random() >= self.loss:
                        self.agents[j].receive([agent.promise(sent[i][0], force[i])])
        self.forces.append(force)
        self.states.append((q + PERIOD * v + 0.5 * PERIOD**2 * force, v + PERIOD * force))

    def _living(self):
        return np.array([i not in self.dead for i in range(len(self.agents))])

    def report(self, who=None):
        q, v = (np.array(each) for each in zip(*self.states, strict=True))
        return verify_motion(self.fleet, PERIOD * np.arange(len(q)), q, v, np.array(self.forces))


def fly(space, most, until=None):
    for _ in range(most):
        if (until or (lambda: space.true.complete))():
            break
        space.step()
    return space


@pytest.mark.parametrize("seed", range(3))
def test_agents_by_themselves_cover_everything_and_keep_every_bound(seed):
    space = fly(Airspace(seed), 400)
    assert space.true.complete
    assert (report := space.report()).holds, str(report.first_failure)
    knows = lambda: all(agent.known.complete for agent in space.agents)  # noqa: E731
    assert fly(space, 30, knows).true.complete
    assert knows(), "word of the end gets round"


def test_their_maps_over_estimate_under_loss_and_every_bound_holds():
    space = Airspace(3, loss=0.05)
    for _ in range(120):
        space.step()
        for agent in space.agents:
            assert (agent.known.residual >= space.true.residual).all()
    assert (report := space.report()).holds, str(report.first_failure)
    assert space.true.fraction > 0.5, "braking now and then does not keep them from covering"


def test_the_same_seed_gives_the_same_flight():
    first, second = fly(Airspace(5), 60), fly(Airspace(5), 60)
    assert (np.array(first.states) == np.array(second.states)).all()


def test_whoever_hears_nobody_stops_and_so_do_those_whom_it_does_not_hear():
    space = Airspace(0)
    for _ in range(6):
        space.step()
    space.deaf.add(2)
    for _ in range(4):
        space.step()
    near = adjacency(space.states[-1][0], 4.0)[2]
    speed = np.linalg.norm(space.states[-1][1], axis=1)
    assert speed[2] < 1e-9
    assert (speed[near] < 1e-9).all(), "its word tells them that it has not heard them"
    assert space.report().holds


def test_the_others_finish_without_the_dead_and_keep_clear_of_it():
    space = Airspace(1, lost_after=6)
    for _ in range(10):
        space.step()
    q = space.states[-1][0]
    apart = adjacency(q, 3.0)
    leaf = next(i for i in range(5) if connected(np.delete(np.delete(apart, i, 0), i, 1)))
    space.dead.add(leaf)
    fly(space, 500)
    assert space.true.complete
    assert all(space.agents[i].lost[leaf] for i in range(5) if i != leaf and apart[i, leaf])
    found = {check.name: check for check in space.report().checks}
    assert found["separation"].holds, str(found["separation"])
    living = [i for i in range(5) if i != leaf]
    for position, _ in space.states[10:]:
        assert connected(adjacency(position[living], 4.0))


def test_one_that_comes_back_is_no_longer_lost():
    space = Airspace(4, lost_after=6)
    for _ in range(4):
        space.step()
    space.dead.add(0)
    for _ in range(12):
        space.step()
    assert any(agent.lost[0] for agent in space.agents[1:])
    space.dead.clear()
    for _ in range(3):
        space.step()
    hears = adjacency(space.states[-1][0], 4.0)[1:, 0]
    assert not any(agent.lost[0] for agent, near in zip(space.agents[1:], hears, strict=True) if near)
    assert space.report().holds


def connected(adjacent):
    reached = np.eye(len(adjacent), dtype=bool)[0]
    for _ in adjacent:
        reached = reached | (adjacent[reached].any(axis=0))
    return bool(reached.all())
