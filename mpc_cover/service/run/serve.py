"""The controller and agent daemons as processes: `mpc-cover serve` and `mpc-cover agent`."""

from __future__ import annotations

import os
import sys
import time
import uuid
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from threading import Event, Thread
from typing import TYPE_CHECKING, TypeVar

from mpc_cover.clock import MonotonicClock
from mpc_cover.errors import UserError
from mpc_cover.output import free_path
from mpc_cover.service.protocol.keys import Keys
from mpc_cover.service.protocol.messages import Phase
from mpc_cover.service.protocol.network import LEASE_MS
from mpc_cover.service.protocol.transport import open_transport
from mpc_cover.service.run.daemon import Signals, run
from mpc_cover.service.run.run_folder import flown_in, run_path
from mpc_cover.service.run.served_run import ServedRun
from mpc_cover.service.run.standing_place import standing_place

if TYPE_CHECKING:
    from collections.abc import Callable

    from mpc_cover.arrays import FloatArray
    from mpc_cover.clock import Clock
    from mpc_cover.mission.load import Mission
    from mpc_cover.service.controller.controller import Controller
    from mpc_cover.service.controller.state_directory import StateDirectory
    from mpc_cover.service.protocol.bus import Transport
    from mpc_cover.service.protocol.network import NetworkOptions
    from mpc_cover.service.run.daemon import Participant

A = TypeVar("A", bound="Participant")

ASK_S = 1.0
"""How long to ask the network at most which controllers there are [s]; answers come in milliseconds."""
STATUS_EVERY_S = 2.0
"""How often `serve` writes a status line [s of the machine's clock]."""


@dataclass(frozen=True)
class ServeOptions:
    """See `mpc-cover serve --help`."""

    backend: str = "native"
    seed: int = 0
    speed: float = 1.0
    state_dir: Path | None = None
    fresh: bool = False
    stay: bool = False
    step_log: Path | None = None
    with_parent: bool = False
    out: Path | None = None
    overwrite: bool = False


@dataclass(frozen=True)
class AgentOptions:
    """See `mpc-cover agent --help`."""

    speed: float = 1.0
    record: Path | None = None
    with_parent: bool = False
    seed: int = 0


def serve(mission: Mission, options: ServeOptions, network: NetworkOptions) -> int:
    """Control a mission until it is over or a signal comes, and leave a run folder; return the exit status.

    A demo's controller leaves none: the demo does.

    Raises
    ------
    UserError
        The network or the state directory cannot be used as asked.
    """
    from mpc_cover.service.controller.state_directory import StateDirectory  # noqa: PLC0415 - only here

    path = options.state_dir or Path(".mpc-cover") / mission.spec.name
    with Signals(child=options.with_parent) as signals, StateDirectory(path) as folder:
        follow_parent(options.with_parent, signals.stop)
        clock = MonotonicClock(options.speed)
        place = None if options.with_parent else _run_path(mission, options, folder)
        try:
            transport = open_transport(network, clock, signals.stop)
        except InterruptedError:
            return signals.exit_status
        try:
            identity = uuid.uuid4().hex
            refuse_second(mission, transport, signals.stop)
            transport.announce(Keys(mission.spec.name).controller_instance(identity))  # before what takes a second
            meta = {"seed": options.seed, "backend": options.backend}
            tell = speaker(network)
            record = None if place is None else ServedRun(mission, place, meta, options.speed, tell)
            tell(f"controls {mission.spec.name} at {network.where}")
            controller = _controller(mission, options, folder, transport, clock, identity, record, tell)
            look_s = mission.spec.control.state_period_s
            lines = _StatusLines(controller, tell)
            run(controller, clock, signals.stop, lines.after_tick, look_s, controller.idle)
        finally:
            transport.close()
        if record is not None:
            record.write(controller)
        unfinished = not controller.done and not (options.stay and controller.exit_status == 0)
        return signals.exit_status if unfinished else controller.exit_status


def _run_path(mission: Mission, options: ServeOptions, folder: StateDirectory) -> Path:
    """Return where the run goes: a mission that is resumed goes on in a folder beside that of its last part."""
    from mpc_cover.service.controller.checkpoint import FileCheckpoints  # noqa: PLC0415 - only here

    if options.out is not None and not (options.fresh or options.overwrite) and flown_in(options.out) is not None:
        resume, _ = FileCheckpoints(folder, mission).load()
        if resume is not None:
            return free_path(options.out)
    return run_path(options.out, mission, overwrite=options.overwrite)


def refuse_second(mission: Mission, transport: Transport, stop: Event) -> None:
    """Make sure that no other controller of a mission is on the network.

    One that has died is there for as long as its lease.

    Raises
    ------
    UserError
        There is one.
    """
    keys, give_up_s = Keys(mission.spec.name), time.monotonic() + 1.5 * LEASE_MS / 1000.0
    while there := transport.alive(keys.controller_instance(), ASK_S):
        if time.monotonic() > give_up_s or stop.wait(ASK_S / 4.0):
            who = ", ".join(sorted(key.rsplit("/", 1)[-1][:8] for key in there))
            raise UserError(
                f"mission {mission.spec.name}: controller {who} is on this network already: end that one first, or"
                " give this mission another name"
            )


def run_agent(mission: Mission, agent_id: str, options: AgentOptions, network: NetworkOptions) -> int:
    """Run an agent until a signal comes; return the exit status.

    Raises
    ------
    UserError
        The mission has no such agent, or the network cannot be used as asked.
    """
    from mpc_cover.service.agent.agent import Agent  # noqa: PLC0415 - the controller needs none

    check_agent_id(mission, agent_id)
    text = f"{agent_id}: agent of {mission.spec.name}, reaches {network.where}"
    here = partial(standing_place, mission, agent_id, speed=options.speed)
    agent, status = run_agent_process(Agent, mission, agent_id, options, network, text, here)
    if agent is not None and agent.taken_by:
        own = f"this one is instance {agent.instance[:8]}"
        raise UserError(
            f"agent {agent_id}: another process, instance {agent.taken_by[:8]}, is {agent_id} of mission"
            f" {mission.spec.name} already, and {own}: end that one first, or give another --id"
        )
    return status


def speaker(network: NetworkOptions) -> Callable[[str], None]:
    """Return what writes the lines of a process: each begins with a warning where anybody may steer the fleet."""
    return (lambda text: say(f"INSECURE, anybody may steer: {text}")) if network.insecure else say


def check_agent_id(mission: Mission, agent_id: str) -> None:
    """Raise UserError if a mission has no such agent."""
    if agent_id not in mission.fleet.ids:
        known = ", ".join(mission.fleet.ids)
        raise UserError(f"agent {agent_id!r}: is not in mission {mission.spec.name}: its agents are {known}")


def run_agent_process(
    make: Callable[..., A],
    mission: Mission,
    agent_id: str,
    options: AgentOptions,
    network: NetworkOptions,
    text: str,
    here: Callable[[Transport, Event], FloatArray | None] | None = None,
) -> tuple[A | None, int]:
    """Run an agent of a class until it is done or a signal comes; `text` is written once the network is joined.

    `here` returns where its vehicle stands, (d,) [m], None for the mission's start.

    Returns
    -------
    The agent, None if a signal came before it was made; and the exit status for the signals received.

    Raises
    ------
    UserError
        The network cannot be used as asked.
    """
    from mpc_cover.service.agent.recorder import FileRecorder, Header  # noqa: PLC0415 - the controller needs none

    instance = uuid.uuid4().hex
    with Signals(child=options.with_parent) as signals:
        follow_parent(options.with_parent, signals.stop)
        clock = MonotonicClock(options.speed)
        header = Header(agent_id, instance, mission.spec.name, options.speed)
        recorder = FileRecorder(options.record, header, say) if options.record else None
        try:
            transport = open_transport(network, clock, signals.stop)
        except InterruptedError:
            return None, signals.exit_status
        try:
            tell = speaker(network)
            tell(text)
            place = here(transport, signals.stop) if here is not None else None
            if place is not None:
                tell(f"{agent_id}: stands where it was, at {', '.join(f'{x:.2f}' for x in place)}")
            agent = make(
                mission,
                agent_id,
                transport,
                clock,
                instance=instance,
                speed=options.speed,
                seed=options.seed,
                recorder=recorder,
                say=tell,
                **({} if place is None else {"place": place}),
            )
            run(agent, clock, signals.stop)
        finally:
            transport.close()
    return agent, signals.exit_status


def say(text: str) -> None:
    """Write a line to stderr at once, with the local time."""
    sys.stderr.write(f"{time.strftime('%Y-%m-%d %H:%M:%S')} {text}\n")
    sys.stderr.flush()


def _controller(
    mission: Mission,
    options: ServeOptions,
    folder: StateDirectory,
    transport: Transport,
    clock: Clock,
    identity: str,
    record: ServedRun | None,
    tell: Callable[[str], None],
) -> Controller:
    from mpc_cover.control.factory import make_control_law  # noqa: PLC0415 - heavy
    from mpc_cover.service.controller.checkpoint import FileCheckpoints  # noqa: PLC0415 - only here
    from mpc_cover.service.controller.controller import Controller  # noqa: PLC0415 - agents need none
    from mpc_cover.service.controller.step_log import StepLog  # noqa: PLC0415 - likewise

    checkpoints = FileCheckpoints(folder, mission)
    resume, text = checkpoints.load()
    if options.fresh and resume:
        resume, text = None, "starts afresh, as asked; the checkpoint is not used"
    if text:
        tell(text)
    epoch, text = folder.next_epoch(checkpoints.epoch)
    if text:
        tell(text)
    law_for = partial(make_control_law, backend=options.backend, seed=options.seed)
    return Controller(
        mission,
        law_for(mission),
        transport,
        clock,
        epoch=epoch,
        keep_epoch=folder.set_epoch,
        identity=identity,
        speed=options.speed,
        stay=options.stay,
        checkpoints=checkpoints,
        resume=resume,
        law_for=law_for,
        versions=checkpoints.versions,
        step_log=StepLog(options.step_log or (record.step_log if record is not None else None)),
        say=tell,
        recorders=record.recorders if record is not None else (),
    )


class _StatusLines:
    """Writes the controller's status periodically; outside of a flight, only when it says something else."""

    def __init__(self, controller: Controller, tell: Callable[[str], None]) -> None:
        self._controller, self._tell = controller, tell
        self._due_s = 0.0
        self._last = ""

    def after_tick(self) -> None:
        status = self._controller.heartbeat.status
        if status is None or time.monotonic() < self._due_s:
            return
        self._due_s = time.monotonic() + STATUS_EVERY_S
        covered = 100 * status.covered_count // status.cell_count
        line = (
            f"{status.phase}: {status.mission_time_s:.1f} s, {covered} % covered, "
            f"step {status.step_ms:.0f} ms, {status.deadline_misses} deadlines missed"
            + (f"; {status.text}" if status.text != status.phase else "")
        )
        if line != self._last or status.phase is Phase.FLYING:
            self._last = line
            self._tell(line)


def follow_parent(wanted: bool, stop: Event) -> None:
    """Stop when standard input ends: then the parent process has died, even by SIGKILL."""

    def watch() -> None:
        while os.read(0, 1024):
            pass
        stop.set()

    if wanted:
        Thread(target=watch, daemon=True).start()
