"""The simulation: the controller and its agents in one process, on a virtual clock and an in-memory bus.

It is deterministic.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from threading import Event
from typing import TYPE_CHECKING

from mpc_cover.clock import VirtualClock
from mpc_cover.control.factory import make_control_law
from mpc_cover.planning.budget import Budget
from mpc_cover.service.agent.agent import Agent
from mpc_cover.service.controller.controller import Controller
from mpc_cover.service.protocol.local import LocalBus
from mpc_cover.service.protocol.messages import Phase
from mpc_cover.service.run.fault_injection import check_deaths
from mpc_cover.service.run.recording import merge
from mpc_cover.service.run.simulated_agent import SimulatedAgent
from mpc_cover.trajectory_file import RecordingKind
from mpc_cover.version import __version__

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from mpc_cover.control.control_law import ControlLaw
    from mpc_cover.mission.load import Mission
    from mpc_cover.service.controller.step_log import Step
    from mpc_cover.service.protocol.messages import Status
    from mpc_cover.service.run.daemon import Participant
    from mpc_cover.trajectory_file import Recording


@dataclass(frozen=True, eq=False)
class Simulation:
    """The result of a simulation.

    Attributes
    ----------
    trajectory : what was flown.
    steps : the control steps.
    events : the texts of all events.
    complete : whether everything was covered.
    lost : ids of the lost agents.
    outcome : how it ended, as a text.
    interrupted : whether it was broken off by Ctrl-C: the trajectory is what was flown until then.
    """

    trajectory: Recording
    steps: list[Step]
    events: list[str]
    complete: bool
    lost: tuple[str, ...] = ()
    outcome: str = ""
    interrupted: bool = False


def simulate(
    mission: Mission,
    *,
    backend: str = "native",
    seed: int = 0,
    law: ControlLaw | None = None,
    channel: Callable[[str, bytes], list[bytes]] | None = None,
    deaths: Mapping[str, float] | None = None,
    on_tick: Callable[[Status], None] | None = None,
    keep_on_interrupt: bool = False,
) -> Simulation:
    """Fly a mission; the same mission, back-end and seed give the same trajectory to the last bit.

    Parameters
    ----------
    seed : of the control law, and of the agents' disturbances.
    law : another control law than the receding horizon.
    channel : see `LocalBus`.
    deaths : mission times [s] at which agents die, as if their processes were killed, by id; one must be left.
    on_tick : called with the controller's status after each of its ticks.
    keep_on_interrupt : whether a KeyboardInterrupt in flight ends the flight, and what was flown is returned.
    """
    check_deaths(deaths or {}, mission)
    clock, events = VirtualClock(), list[str]()
    bus = LocalBus(clock, channel)
    simulated_agents = [
        SimulatedAgent(Agent, mission, name, bus, clock, seed=seed, say=events.append) for name in mission.fleet.ids
    ]
    law = law or make_control_law(mission, backend, seed)
    controller = Controller(mission, law, bus.join(), clock, budget_of=Budget.counted, say=events.append)
    interrupted = False
    try:
        _run(clock, simulated_agents, controller, deaths or {}, on_tick)
    except KeyboardInterrupt:
        if not keep_on_interrupt or controller.mission_time_s <= 0.0:
            raise
        interrupted = True
        for simulated in simulated_agents:
            if not simulated.killed:
                simulated.agent.shutdown()
    meta = {"kind": RecordingKind.SIMULATE, "version": __version__, "seed": seed, "backend": backend}
    died = [simulated.agent.id for simulated in simulated_agents if simulated.killed]
    trajectory = merge(mission, [simulated.recorder.pieces for simulated in simulated_agents], meta, died)
    complete = controller.exit_status == 0
    lost, outcome = tuple(controller.supervisor.lost), controller.heartbeat.text
    if interrupted:
        outcome = f"interrupted at mission time {controller.mission_time_s:.1f} s"
    return Simulation(trajectory, list(controller.step_log.steps), events, complete, lost, outcome, interrupted)


def _run(
    clock: VirtualClock,
    simulated_agents: list[SimulatedAgent[Agent]],
    controller: Controller,
    deaths: Mapping[str, float],
    on_tick: Callable[[Status], None] | None,
) -> None:
    """Tick the participant that is due next, agents before the controller at the same instant."""

    def running() -> list[Participant]:
        return [*(simulated.agent for simulated in simulated_agents if not simulated.killed), controller]

    for participant in running():
        participant.startup()
    never = Event()
    while not controller.done:
        due = min(running(), key=lambda participant: participant.next_time)
        if (dying := _next_to_die(simulated_agents, deaths)) and controller.phase is Phase.FLYING:
            left_s = deaths[dying.agent.id] - controller.mission_time_s
            if left_s <= due.next_time - clock.now():  # before any tick at the same instant
                clock.wait_until(clock.now() + max(left_s, 0.0), never)
                dying.kill()
                continue
        clock.wait_until(due.next_time, never)
        due.tick()
        if due is not controller:
            continue
        controller.idle(math.inf)
        if on_tick and controller.heartbeat.status:
            on_tick(controller.heartbeat.status)
    for participant in running():
        participant.shutdown()


def _next_to_die(
    simulated_agents: list[SimulatedAgent[Agent]], deaths: Mapping[str, float]
) -> SimulatedAgent[Agent] | None:
    """Return the agent whose death is next; None if none is to come."""
    dying = [simulated for simulated in simulated_agents if not simulated.killed and simulated.agent.id in deaths]
    return min(dying, key=lambda simulated: deaths[simulated.agent.id], default=None)
