"""Agents of a simulation, which can be killed like processes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Generic, Protocol, TypeVar

from mpc_cover.service.agent.recorder import MemoryRecorder

if TYPE_CHECKING:
    from collections.abc import Callable

    from mpc_cover.clock import Clock
    from mpc_cover.mission.load import Mission
    from mpc_cover.service.agent.recorder import Recorder
    from mpc_cover.service.protocol.bus import Transport
    from mpc_cover.service.protocol.local import LocalBus

A = TypeVar("A")
Made_co = TypeVar("Made_co", covariant=True)


class AgentFactory(Protocol[Made_co]):
    """Makes an agent of a class; see `Agent` and `SwarmAgent`."""

    def __call__(
        self,
        mission: Mission,
        agent_id: str,
        transport: Transport,
        clock: Clock,
        *,
        instance: str,
        seed: int,
        recorder: Recorder | None,
        say: Callable[[str], None],
    ) -> Made_co:
        """Return an agent."""
        ...


class SimulatedAgent(Generic[A]):
    """An agent on an in-memory bus, with its record, and whether it was killed."""

    def __init__(
        self,
        make: AgentFactory[A],
        mission: Mission,
        name: str,
        bus: LocalBus,
        clock: Clock,
        *,
        seed: int,
        say: Callable[[str], None],
    ) -> None:
        self.killed = False
        self.recorder = MemoryRecorder()
        self._transport = bus.join()
        self.agent = make(
            mission,
            name,
            self._transport,
            clock,
            instance=f"{name}-simulated",
            seed=seed,
            recorder=self.recorder,
            say=say,
        )

    def kill(self) -> None:
        """Kill the agent without a shutdown: it moves, records and sends nothing more."""
        self.killed = True
        self._transport.close()
