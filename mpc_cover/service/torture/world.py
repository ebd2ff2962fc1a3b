"""A simulated flight under faults: the real controller and the real agents, in one process, on virtual time."""

from __future__ import annotations

import hashlib
import json
import math
import random
import shutil
import tempfile
import time as time_module
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.control.factory import make_control_law
from mpc_cover.planning.budget import Budget
from mpc_cover.service.agent.agent import Agent
from mpc_cover.service.controller.checkpoint import FileCheckpoints
from mpc_cover.service.controller.controller import Controller
from mpc_cover.service.controller.state_directory import StateDirectory
from mpc_cover.service.protocol.messages import Phase
from mpc_cover.service.torture.bodies import Body
from mpc_cover.service.torture.channel import Channel
from mpc_cover.service.torture.disk import Disk
from mpc_cover.service.torture.faults import CONTROLLER, LINK_KINDS, Fault, FaultKind
from mpc_cover.service.torture.faulty_law import FaultyLaw
from mpc_cover.service.torture.network import LEASE_S, SimulatedNetwork
from mpc_cover.service.torture.oracle import Violation, judge
from mpc_cover.service.torture.processes import Process
from mpc_cover.service.torture.virtual_time import VirtualTime

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from mpc_cover.arrays import BoolArray
    from mpc_cover.mission.load import Mission
    from mpc_cover.service.agent.recorder import Piece

WORK_SHARE = 0.05
"""Seconds of work that the planner may count in a second of virtual time; a plain choice: flights cost a twentieth."""
RETRY_S = 1.0
"""After so long a controller that could not start is started again [s]; a plain choice, as of a supervising system."""
_ORIGIN_S = 1e5
"""Monotonic clocks begin up to so long before the simulation [s]: machines were started at different times."""


@dataclass(frozen=True, eq=False)
class Outcome:
    """What became of a flight.

    Attributes
    ----------
    finished : whether the controller ended with everything covered.
    text : how it ended, in words.
    covered_s : from the take-off to the end [s]; inf where it did not finish.
    violations : what the oracle saw.
    smallest_m : the smallest distance between two agents [m].
    digest : of all messages and motions: the same flight has the same.
    motions : the true motion of each agent, by id, in virtual time.
    died : ids of the agents whose process died and did not come back.
    events : what controller and agents said, with its time.
    """

    finished: bool
    text: str
    covered_s: float
    violations: tuple[Violation, ...]
    smallest_m: float
    digest: str
    motions: Mapping[str, Sequence[Piece]]
    died: tuple[str, ...]
    events: tuple[str, ...]


def fly(mission: Mission, faults: Sequence[Fault], seed: int, *, limit_s: float, backend: str = "native") -> Outcome:
    """Fly a mission under faults, at most for `limit_s` of virtual time; the same arguments give the same outcome."""
    with tempfile.TemporaryDirectory(prefix="mpc-cover-torture-") as folder:
        return _World(mission, faults, seed, limit_s, backend, Path(folder)).fly()


class _World:
    def __init__(
        self, mission: Mission, faults: Sequence[Fault], seed: int, limit_s: float, backend: str, folder: Path
    ) -> None:
        self._mission, self._faults, self._seed, self._backend = mission, faults, seed, backend
        self._limit_s, self._state_dir = limit_s, folder / "state"
        self._time = VirtualTime()
        self._network = SimulatedNetwork(self._time, Channel(faults, f"{mission.spec.name}/{seed}"))
        self._network.rewrite = self._rewrite
        self._disk = Disk(self._state_dir, faults, str(seed))
        self._events: list[str] = []
        self._processes: dict[str, Process] = {}
        self._taken_over: dict[Fault, Process] = {}
        self._full = 0
        self._crashes: list[Violation] = []
        self._last: Controller | None = None
        self._over_s = self._flown_until_s = math.inf
        self._frozen: dict[Fault, tuple[list[float], list[float]]] = {}
        fleet = mission.fleet
        self._bodies = {
            name: Body(name, float(limit), start)
            for name, limit, start in zip(fleet.ids, fleet.input_max, fleet.start, strict=True)
        }

    def fly(self) -> Outcome:
        """Start everyone, let time pass until the flight is over, and judge it."""
        for fault in self._faults:
            self._plan(fault)
        for name in self._bodies:
            self._start_agent(name)
        self._start_controller()
        wall, time_module.time = time_module.time, self._wall  # whoever reads the wall clock sees its steps
        try:
            self._time.run(self._limit_s, lambda: self._time.now_s >= self._over_s)
            return self._judge()
        finally:
            time_module.time = wall
            for process in (*self._processes.values(), *self._taken_over.values()):
                process.kill()

    def _wall(self) -> float:
        return self._time.now_s + self._time.wall_step_s

    # -- processes

    def _process(self, name: str) -> Process:
        chance = random.Random(f"{self._seed}/{name}/clock")  # noqa: S311 - reproducible, no secret
        drift = next((f.jitter_s for f in self._faults if f.kind is FaultKind.CLOCKS and f.strikes(name)), 0.0)
        origin_s, rate = chance.uniform(0.0, _ORIGIN_S), 1.0 + chance.uniform(-drift, drift)
        process = Process(name, self._time, origin_s, rate, str(self._seed))
        self._processes[name] = process
        process.on_end.append(partial(self._ended, process))
        return process

    def _ended(self, process: Process) -> None:
        if process.crash:
            self._crashes.append(Violation("crash", self._time.now_s, (process.name,), text=process.crash[-400:]))

    def _say(self, text: str) -> None:
        self._events.append(f"{self._time.now_s:.3f} {text}")

    def _start_agent(self, name: str) -> None:
        body, life = self._bodies[name], len(self._bodies[name].lives)
        at = body.at(self._time.now_s)
        process = self._process(name)
        recorder = body.begin(process)

        def make() -> Agent:
            return Agent(
                self._mission,
                name,
                self._network.join(process),
                process.clock,
                instance=f"{name}-life-{life}",
                seed=self._seed,
                recorder=recorder,
                say=self._say,
                place=at,
            )

        process.start(make)

    def _start_twin(self, fault: Fault) -> None:
        name = fault.targets[0]
        process = self._process(f"{name}-twin")

        def make() -> Agent:
            transport = self._network.join(process)
            return Agent(self._mission, name, transport, process.clock, instance=f"{name}-twin", say=self._say)

        process.start(make)

    def _start_controller(self) -> None:
        process = self._process(CONTROLLER)
        process.on_end.append(partial(self._controller_ended, process))
        make = partial(self._controller, process, self._state_dir)
        process.start(make, self._mission.spec.control.state_period_s)

    def _controller(self, process: Process, state_dir: Path) -> Controller:
        mission = self._mission
        folder = StateDirectory(state_dir)
        process.on_end.append(folder.close)
        checkpoints = FileCheckpoints(folder, mission, process.clock.now)
        resume, text = checkpoints.load()
        epoch, repaired = folder.next_epoch(checkpoints.epoch)
        self._say(f"controller of epoch {epoch} starts {text} {repaired}".rstrip())
        law = make_control_law(mission, self._backend, self._seed)
        controller = Controller(
            mission,
            FaultyLaw(law, process, self._faults, WORK_SHARE, mission.fleet),
            self._network.join(process),
            process.clock,
            epoch=epoch,
            keep_epoch=folder.set_epoch,
            identity=f"controller-{epoch}",
            budget_of=lambda seconds: Budget.counted(WORK_SHARE * seconds),
            checkpoints=checkpoints,
            resume=resume,
            versions=checkpoints.versions,
            say=self._say,
        )
        self._last = controller
        return controller

    def _controller_ended(self, process: Process) -> None:
        if process is not self._processes[CONTROLLER]:
            return  # another one has taken over from it
        if process.unable:
            self._say(f"controller cannot start: {process.unable}")
            self._time.at(self._time.now_s + RETRY_S, self._start_controller)
            return
        self._disk.crash(self._time.now_s)
        self._flown_until_s = self._time.now_s
        self._end_soon()

    def _end_soon(self) -> None:
        """Let the flight end once no fault is to come and every plan is flown to its end."""
        lasts = max((fault.end_s for fault in self._faults if fault.kind in LINK_KINDS), default=0.0)
        self._over_s = max(self._time.now_s, lasts) + self._mission.spec.control.horizon_s + 2.0 * LEASE_S

    # -- faults

    def _plan(self, fault: Fault) -> None:
        begin, end = {
            FaultKind.CUTS: (self._cut, self._join_again),
            FaultKind.DEATHS: (self._kill, None),
            FaultKind.RESTARTS: (self._kill, self._restart),
            FaultKind.STOPS: (self._stop, self._proceed),
            FaultKind.TAKEOVERS: (self._take_over, self._continue_old),
            FaultKind.SLOW: (self._slow, self._fast),
            FaultKind.TWINS: (self._start_twin, self._end_twin),
            FaultKind.CLOCKS: (self._step, None),
            FaultKind.DISK: (self._fill, self._empty),
        }.get(fault.kind, (None, None))
        if begin is not None:
            self._time.at(fault.start_s, partial(begin, fault))
        if end is not None:
            self._time.at(fault.end_s, partial(end, fault))

    def _struck(self, fault: Fault) -> list[Process]:
        return [p for name, p in self._processes.items() if fault.strikes(name) and p.alive]

    def _cut(self, fault: Fault) -> None:
        if not fault.keeps_token:
            self._network.begin_silence(fault.targets)

    def _join_again(self, fault: Fault) -> None:
        self._network.end_silence(fault.targets)

    def _kill(self, fault: Fault) -> None:
        for process in self._struck(fault):
            if fault.way == "publishing" and process.name == CONTROLLER:
                for transport in self._network.of(process):
                    transport.dies_after = 1 + int(fault.share * self._mission.fleet.size)
                continue
            if process.stopped and isinstance(process.participant, Agent):  # its body has flown on meanwhile
                agent = process.participant
                agent.vehicle.advance(process.clock.at(self._time.now_s), agent.schedule)
            process.kill()

    def _restart(self, fault: Fault) -> None:
        for name in fault.targets:
            process = self._processes[name]
            process.kill()
            if name == CONTROLLER:
                if not process.ended:
                    self._over_s = self._flown_until_s = math.inf
                    self._start_controller()
            else:
                self._start_agent(name)

    def _stop(self, fault: Fault) -> None:
        for process in self._struck(fault):
            process.stop()
            if not fault.held:
                self._network.stopped_lose.add(process)
        if not fault.keeps_token:
            self._network.begin_silence(fault.targets)

    def _proceed(self, fault: Fault) -> None:
        for process in self._struck(fault):
            self._network.stopped_lose.discard(process)
            process.proceed()
        self._network.end_silence(fault.targets)

    def _take_over(self, fault: Fault) -> None:
        """Stop the controller, and start another one on a copy of what it has on its disk."""
        old = self._processes[CONTROLLER]
        if not old.alive:
            return
        old.stop()
        if not fault.held:
            self._network.stopped_lose.add(old)
        self._taken_over[fault] = old
        copy = self._state_dir.with_name(f"state-{len(self._taken_over)}")
        shutil.copytree(self._state_dir, copy, ignore=shutil.ignore_patterns("lock"))
        self._state_dir = copy
        self._start_controller()

    def _continue_old(self, fault: Fault) -> None:
        if (old := self._taken_over.get(fault)) is not None and old.alive:
            self._network.stopped_lose.discard(old)
            old.proceed()

    def _slow(self, fault: Fault) -> None:
        for process in self._struck(fault):
            process.lag_s = fault.delay_s

    def _fast(self, fault: Fault) -> None:
        for process in self._struck(fault):
            process.lag_s = 0.0

    def _end_twin(self, fault: Fault) -> None:
        self._processes[f"{fault.targets[0]}-twin"].kill()

    def _step(self, fault: Fault) -> None:
        for process in self._struck(fault):
            process.clock.step_s += fault.delay_s

    def _fill(self, fault: Fault) -> None:
        if fault.way == "full":
            self._full += 1
            self._disk.fill(full=True)

    def _empty(self, fault: Fault) -> None:
        if fault.way == "full":
            self._full -= 1
            self._disk.fill(full=self._full > 0)

    def _rewrite(self, name: str, key: str, payload: bytes) -> bytes:
        """Let agents that are frozen report the same place again and again."""
        if not key.endswith("/state"):
            return payload
        for fault in self._faults:
            if fault.kind is FaultKind.FROZEN and fault.on(self._time.now_s) and fault.strikes(name):
                state = json.loads(payload)
                place = self._frozen.setdefault(fault, (state["position"], state["velocity"]))
                state["position"], state["velocity"] = place
                return json.dumps(state).encode()
        return payload

    # -- the end

    def _judge(self) -> Outcome:
        end_s = self._time.now_s
        for process in self._processes.values():
            if process.alive and isinstance(process.participant, Agent):
                agent = process.participant
                agent.vehicle.advance(process.clock.at(end_s), agent.schedule)
        motions = {name: body.motion(end_s) for name, body in self._bodies.items()}
        controller = self._last
        finished = controller is not None and controller.phase is Phase.COMPLETE
        sight = judge(self._mission, motions, end_s, apart=self._apart(end_s), claimed=self._claimed(finished))
        digest = hashlib.sha256(self._network.digest.encode())
        for name, pieces in motions.items():
            digest.update(f"{name} {[(p.time_s, p.position, p.velocity, p.input) for p in pieces]!r}".encode())
        return Outcome(
            finished,
            controller.heartbeat.text if controller is not None else "no controller",
            self._flown_until_s - _took_off(motions) if finished else math.inf,
            tuple(sorted((*sight.violations, *self._crashes), key=lambda violation: violation.time_s)),
            sight.smallest_m,
            digest.hexdigest(),
            motions,
            tuple(name for name in self._bodies if not self._processes[name].alive and not self._processes[name].ended),
            tuple(self._events),
        )

    def _claimed(self, finished: bool) -> BoolArray | None:
        """Return what the controller says to have covered: everything, when it says that it is complete."""
        spec = self._mission.spec
        plain = spec.information is None and len(spec.magnitudes) == 1 and spec.area.weights is None
        if not plain or self._last is None:
            return None
        return np.ones(self._mission.field.size, dtype=bool) if finished else self._last.coverage.settled

    def _apart(self, end_s: float) -> list[tuple[float, float]]:
        """Return when somebody may be out of range: while links are down, and until those parted have met again."""
        again_s = self._mission.spec.control.horizon_s
        spans = []
        for fault in self._faults:
            if fault.kind in LINK_KINDS:
                for_good = fault.kind is FaultKind.DEATHS
                spans.append((fault.start_s, math.inf if for_good else fault.end_s + again_s))
        if self._flown_until_s < end_s:
            spans.append((self._flown_until_s, math.inf))
        return spans


def _took_off(motions: Mapping[str, Sequence[Piece]]) -> float:
    """Return when the first plan was flown [s]; inf where none was."""
    return min(
        (piece.time_s for pieces in motions.values() for piece in pieces if piece.plan is not None), default=math.inf
    )
