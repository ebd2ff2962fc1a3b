"""The simulation of the distributed law: its agents in one process, on a virtual clock and an in-memory bus.

It is deterministic.
"""

from __future__ import annotations

from dataclasses import dataclass
from threading import Event
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.clock import VirtualClock
from mpc_cover.control.controller_name import ControllerName
from mpc_cover.service.protocol.local import LocalBus
from mpc_cover.service.run.recording import merge
from mpc_cover.service.run.simulated_agent import SimulatedAgent
from mpc_cover.service.run.swarm_observer import SwarmObserver
from mpc_cover.service.swarm.agent import SwarmAgent
from mpc_cover.trajectory_file import RecordingKind
from mpc_cover.version import __version__

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from mpc_cover.mission.load import Mission
    from mpc_cover.service.protocol.messages import Status
    from mpc_cover.trajectory_file import Recording


@dataclass(frozen=True, eq=False)
class SwarmFlight:
    """The result of a simulation.

    Attributes
    ----------
    trajectory : what was flown.
    events : the texts of all events.
    complete : whether all agents left know that everything is covered.
    lost : ids of the agents that died.
    decision_times_s : durations of all decisions of each agent [s], by id.
    messages, bytes : sent by all agents in flight; each broadcast counts once, however many receive it.
    estimate_errors : root mean square error of each agent's own estimate of the field, by id; of Kalman maps.
    """

    trajectory: Recording
    events: list[str]
    complete: bool
    lost: tuple[str, ...]
    decision_times_s: dict[str, list[float]]
    messages: int
    bytes: int
    estimate_errors: dict[str, float]
    interrupted: bool = False

    @property
    def outcome(self) -> str:
        """How it ended, as a text."""
        if self.interrupted:
            return "interrupted"
        if not self.complete:
            return "not everyone knows that everything is covered"
        return f"everything is covered without {', '.join(self.lost)}" if self.lost else "everything is covered"


def fly_swarm(
    mission: Mission,
    *,
    seed: int = 0,
    channel: Callable[[str, bytes], list[bytes]] | None = None,
    deaths: Mapping[str, float] | None = None,
    on_tick: Callable[[Status], None] | None = None,
    keep_on_interrupt: bool = False,
) -> SwarmFlight:
    """Fly a mission by the potential law; the same mission and seed give the same trajectory to the last bit.

    Parameters
    ----------
    seed : of the random signals, the order of escapes, and the agents' disturbances.
    channel : see `LocalBus`.
    deaths : mission times [s] at which agents die, as if their processes were killed, by id.
    on_tick : called with the status after each sample.
    keep_on_interrupt : whether a KeyboardInterrupt in flight ends the flight, and what was flown is returned.

    Raises
    ------
    UserError
        The law cannot fly this mission.
    """
    clock, events = VirtualClock(), list[str]()
    bus = LocalBus(clock, channel)
    simulated_agents = [
        SimulatedAgent(SwarmAgent, mission, name, bus, clock, seed=seed, say=events.append)
        for name in mission.fleet.ids
    ]
    observer = SwarmObserver(mission, bus.join(), clock)
    interrupted = False
    try:
        _run(clock, simulated_agents, deaths or {}, (observer, on_tick) if on_tick else None)
    except KeyboardInterrupt:
        flown = [simulated.agent for simulated in simulated_agents if not simulated.killed]
        if not keep_on_interrupt or not all(agent.start_s < clock.now() for agent in flown):
            raise
        interrupted = True
        for agent in flown:
            agent.shutdown()
    died = [simulated.agent.id for simulated in simulated_agents if simulated.killed]
    meta = {
        "kind": RecordingKind.SIMULATE,
        "version": __version__,
        "seed": seed,
        "controller": ControllerName.POTENTIAL,
    }
    return SwarmFlight(
        trajectory=merge(mission, [simulated.recorder.pieces for simulated in simulated_agents], meta, died),
        events=events,
        complete=len(died) < len(simulated_agents)
        and all(simulated.killed or simulated.agent.exit_status == 0 for simulated in simulated_agents),
        lost=tuple(died),
        decision_times_s={simulated.agent.id: simulated.agent.decision_times_s for simulated in simulated_agents},
        messages=sum(simulated.agent.sent["messages"] for simulated in simulated_agents),
        bytes=sum(simulated.agent.sent["bytes"] for simulated in simulated_agents),
        interrupted=interrupted,
        estimate_errors={
            simulated.agent.id: error
            for simulated in simulated_agents
            if not simulated.killed and (error := simulated.agent.estimate_error) is not None
        },
    )


def _run(
    clock: VirtualClock,
    simulated_agents: list[SimulatedAgent[SwarmAgent]],
    deaths: Mapping[str, float],
    watch: tuple[SwarmObserver, Callable[[Status], None]] | None,
) -> None:
    """Tick the agent that is due next, in the order of the mission's agents at the same instant."""
    never, shown = Event(), -np.inf
    for simulated in simulated_agents:
        simulated.agent.startup()
    while flying := [simulated for simulated in simulated_agents if _flies(simulated)]:
        due = min(flying, key=lambda simulated: simulated.agent.next_time)
        time_s = due.agent.next_time
        for simulated in simulated_agents:
            if time_s - simulated.agent.start_s >= deaths.get(simulated.agent.id, np.inf):
                simulated.kill()
        if not _flies(due):
            continue
        clock.wait_until(time_s, never)
        due.agent.tick()
        if watch and time_s > shown:
            shown = time_s
            _show(*watch)
    for simulated in simulated_agents:
        if not simulated.killed:
            simulated.agent.shutdown()


def _flies(simulated: SimulatedAgent[SwarmAgent]) -> bool:
    """Return whether an agent is neither killed nor done."""
    return not simulated.killed and not simulated.agent.done


def _show(observer: SwarmObserver, on_tick: Callable[[Status], None]) -> None:
    observer.look()
    if observer.status is not None:
        on_tick(observer.status)
