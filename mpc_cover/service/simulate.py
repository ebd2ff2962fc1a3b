"""The same controller and agents in one process, on a virtual clock and a bus in memory: deterministic."""

from __future__ import annotations

from dataclasses import dataclass
from threading import Event
from typing import TYPE_CHECKING

from mpc_cover import __version__
from mpc_cover.clock import VirtualClock
from mpc_cover.service.agent import Agent
from mpc_cover.service.brain import make_brain
from mpc_cover.service.controller import Controller
from mpc_cover.service.local import LocalBus
from mpc_cover.service.recorder import MemoryRecorder
from mpc_cover.service.recording import merge

if TYPE_CHECKING:
    from collections.abc import Callable

    from mpc_cover.mission.load import Mission
    from mpc_cover.service.brain import Brain
    from mpc_cover.service.daemon import Participant
    from mpc_cover.service.messages import Status
    from mpc_cover.service.step_log import Step
    from mpc_cover.trajectory import Trajectory


@dataclass(frozen=True, eq=False)
class Simulation:
    """What was flown, how long each step took, what was said, and whether everything was covered."""

    trajectory: Trajectory
    steps: list[Step]
    events: list[str]
    complete: bool


def simulate(
    mission: Mission,
    *,
    backend: str = "piqp",
    seed: int = 0,
    brain: Brain | None = None,
    channel: Callable[[str, bytes], list[bytes]] | None = None,
    on_tick: Callable[[Status], None] | None = None,
) -> Simulation:
    """Fly a mission; the same mission, back-end and seed give the same trajectory to the last bit.

    Parameters
    ----------
    brain : another controller than the receding horizon.
    channel : see `LocalBus`.
    on_tick : told the controller's status after each of its ticks.
    """
    clock, events = VirtualClock(), list[str]()
    bus = LocalBus(clock, channel)
    recorders = [MemoryRecorder() for _ in mission.fleet.ids]
    agents = [
        Agent(mission, name, bus.join(), clock, instance=f"{name}-simulated", recorder=recorder, say=events.append)
        for name, recorder in zip(mission.fleet.ids, recorders, strict=True)
    ]
    brain = brain or make_brain(mission, backend, seed)
    controller = Controller(mission, brain, bus.join(), clock, deadlines=False, say=events.append)
    _run(clock, agents, controller, on_tick)
    meta = {"kind": "simulate", "version": __version__, "seed": seed, "backend": backend}
    trajectory = merge(mission, [recorder.pieces for recorder in recorders], meta)
    return Simulation(trajectory, list(controller.steps.steps), events, controller.exit_status == 0)


def _run(
    clock: VirtualClock, agents: list[Agent], controller: Controller, on_tick: Callable[[Status], None] | None
) -> None:
    """Tick whoever is due next, agents before the controller at the same instant."""
    participants: list[Participant] = [*agents, controller]
    for participant in participants:
        participant.startup()
    never = Event()
    while not controller.done:
        due = min(participants, key=lambda participant: participant.next_time)
        clock.wait_until(due.next_time, never)
        due.tick()
        if due is controller and on_tick and controller.heartbeat.status:
            on_tick(controller.heartbeat.status)
    for participant in participants:
        participant.shutdown()
