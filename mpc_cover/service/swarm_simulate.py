"""The agents of the distributed law in one process, on a virtual clock and a bus in memory: deterministic."""

from __future__ import annotations

from dataclasses import dataclass
from threading import Event
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover import __version__
from mpc_cover.clock import VirtualClock
from mpc_cover.service.lives import Life
from mpc_cover.service.local import LocalBus
from mpc_cover.service.recording import merge
from mpc_cover.service.swarm_agent import SwarmAgent
from mpc_cover.service.swarm_watch import SwarmObserver

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from mpc_cover.mission.load import Mission
    from mpc_cover.service.messages import Status
    from mpc_cover.trajectory import Trajectory


@dataclass(frozen=True, eq=False)
class SwarmFlight:
    """What was flown, what was said, who died, and what it took.

    Attributes
    ----------
    complete : whether everyone left knows that everything is covered.
    decide_s : what each decision of each agent took [s], by id.
    messages, bytes : sent by all together in flight; each word counts once, however many hear it.
    estimate_errors : root mean square by which each agent's own estimate of the field is off, by id; of Kalman maps.
    """

    trajectory: Trajectory
    events: list[str]
    complete: bool
    lost: tuple[str, ...]
    decide_s: dict[str, list[float]]
    messages: int
    bytes: int
    estimate_errors: dict[str, float]

    @property
    def outcome(self) -> str:
        """How it ended, in words."""
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
) -> SwarmFlight:
    """Fly a mission by the potential law; the same mission and seed give the same trajectory to the last bit.

    Parameters
    ----------
    seed : of the random signals, the order of escapes, and what disturbs the agents.
    channel : see `LocalBus`.
    deaths : at which mission time [s] agents die, as if their processes were killed, by id.
    on_tick : told how things stand after each sample.

    Raises
    ------
    UserError
        The law cannot fly this mission.
    """
    clock, events = VirtualClock(), list[str]()
    line = LocalBus(clock, channel)
    lives = [Life(SwarmAgent, mission, name, line, clock, seed=seed, say=events.append) for name in mission.fleet.ids]
    observer = SwarmObserver(mission, line.join(), clock)
    _run(clock, lives, deaths or {}, (observer, on_tick) if on_tick else None)
    died = [life.agent.id for life in lives if life.dead]
    meta = {"kind": "simulate", "version": __version__, "seed": seed, "controller": "potential"}
    return SwarmFlight(
        trajectory=merge(mission, [life.recorder.pieces for life in lives], meta, died),
        events=events,
        complete=len(died) < len(lives) and all(life.dead or life.agent.exit_status == 0 for life in lives),
        lost=tuple(died),
        decide_s={life.agent.id: life.agent.decide_s for life in lives},
        messages=sum(life.agent.sent["messages"] for life in lives),
        bytes=sum(life.agent.sent["bytes"] for life in lives),
        estimate_errors={
            life.agent.id: error for life in lives if not life.dead and (error := life.agent.estimate_error) is not None
        },
    )


def _run(
    clock: VirtualClock,
    lives: list[Life[SwarmAgent]],
    deaths: Mapping[str, float],
    watch: tuple[SwarmObserver, Callable[[Status], None]] | None,
) -> None:
    """Tick whoever is due next, in the order of the mission's agents at the same instant."""
    never, shown = Event(), -np.inf
    for life in lives:
        life.agent.startup()
    while flying := [life for life in lives if _flies(life)]:
        due = min(flying, key=lambda life: life.agent.next_time)
        time_s = due.agent.next_time
        for life in lives:
            if time_s - life.agent.start_s >= deaths.get(life.agent.id, np.inf):
                life.end()
        if not _flies(due):
            continue
        clock.wait_until(time_s, never)
        due.agent.tick()
        if watch and time_s > shown:
            shown = time_s
            _show(*watch)
    for life in lives:
        if not life.dead:
            life.agent.shutdown()


def _flies(life: Life[SwarmAgent]) -> bool:
    """Return whether an agent is neither dead nor done."""
    return not life.dead and not life.agent.done


def _show(observer: SwarmObserver, on_tick: Callable[[Status], None]) -> None:
    observer.look()
    if observer.status is not None:
        on_tick(observer.status)
