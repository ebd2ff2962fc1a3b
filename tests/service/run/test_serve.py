"""`mpc-cover serve` as a process over Zenoh: what its control law makes of it, no agent is told anything unsafe."""

import json
import os
import subprocess
import sys
from pathlib import Path
from threading import Event, Thread

import faulty_serve
import pytest
import sweep_laws
from service_fakes import small_mission, until

from mpc_cover.clock import MonotonicClock
from mpc_cover.service.agent.agent import Agent
from mpc_cover.service.agent.recorder import MemoryRecorder
from mpc_cover.service.protocol.decoding import Reason, decode_plan, decode_status
from mpc_cover.service.protocol.keys import Keys
from mpc_cover.service.protocol.messages import Phase
from mpc_cover.service.protocol.network import NetworkOptions
from mpc_cover.service.protocol.transport import open_transport
from mpc_cover.service.run.daemon import run
from mpc_cover.service.run.processes import free_port
from mpc_cover.service.run.recording import merge
from mpc_cover.verification.check import check_trajectory

SPEED = 4.0


class FlyingAgents:
    """The agents of a mission in threads, each on the network by itself, until they are told to stop."""

    def __init__(self, mission, endpoint):
        self._stop, self._clock = Event(), MonotonicClock(SPEED)
        self.records = {name: MemoryRecorder() for name in mission.fleet.ids}
        self.agents, self._threads, self._transports = [], [], []
        for name, recorder in self.records.items():
            self._transports.append(join(endpoint, self._clock))
            agent = Agent(mission, name, self._transports[-1], self._clock, speed=SPEED, recorder=recorder)
            self.agents.append(agent)
            self._threads.append(Thread(target=run, args=(agent, self._clock, self._stop)))
            self._threads[-1].start()

    def end(self):
        self._stop.set()
        for thread in self._threads:
            thread.join()
        for transport in self._transports:
            transport.close()


def join(endpoint, clock):
    return open_transport(NetworkOptions(connect=(endpoint,), connect_timeout_s=30.0), clock, Event())


@pytest.fixture
def serve(tmp_path):
    """A controller whose law has every fault in turn: mission, endpoint, process, log."""
    mission, endpoint = small_mission(height=16.0), f"tcp/127.0.0.1:{free_port()}"
    (tmp_path / "mission.yaml").write_text(mission.to_json())
    program, paths = faulty_serve.__file__, [str(Path(sweep_laws.__file__).parent), os.environ.get("PYTHONPATH", "")]
    command = [sys.executable, program, "serve", "mission.yaml", "-l", endpoint, "--speed", f"{SPEED:g}"]
    log, environment = tmp_path / "log", {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}
    with log.open("wb") as out:
        process = subprocess.Popen(command, stdout=out, stderr=out, cwd=tmp_path, env=environment)
    yield mission, endpoint, process, log
    process.kill()
    process.wait()


def test_no_faulty_plan_gets_onto_the_network_and_the_controller_says_why_it_gives_up(serve, tmp_path):
    mission, endpoint, process, log = serve
    keys, ear = Keys(mission.spec.name), join(endpoint, MonotonicClock())
    plans, statuses = ear.inbox(keys.plan("*"), 10_000, history=1), ear.inbox(keys.status, 10_000, history=1)
    flying = FlyingAgents(mission, endpoint)
    try:
        assert process.wait(60.0) == 1, log.read_text()
        until(lambda: all(agent.at_rest for agent in flying.agents))
        seen = [decode_plan(item.payload, 2) for item in plans.drain()]  # a number that is none is no plan at all
        last = decode_status(statuses.drain()[-1].payload)
    finally:
        flying.end()
        ear.close()
    said = log.read_text()
    assert last.phase is Phase.FAILED
    assert last.text == "the safety filter refused 3 plans in a row"
    assert "controller: the safety filter refused 3 plans in a row" in said
    assert "Traceback" not in said
    good = [json.loads(line) for line in (tmp_path / "good.jsonl").read_text().splitlines()]
    assert len(good) >= len(mission.fleet.ids) * (2 + (len(sweep_laws.FAULTS) - 1) // 2), "every fault had its turn"
    assert len(seen) > 2 * len(mission.fleet.ids)
    for plan in seen:
        assert {"position": plan.position, "velocity": plan.velocity, "input": plan.input} in good
    assert {reason for agent in flying.agents for reason in agent.rejected} <= {Reason.EXPIRED, Reason.START}, "late"
    flown = merge(mission, [record.pieces for record in flying.records.values()], {})
    assert check_trajectory(flown).holds
    assert abs(flown.velocity[-1]).max() < 1e-9
