"""Serves the commands to the controller; a repeated request id gets the same reply."""

from __future__ import annotations

from collections import Counter, OrderedDict
from dataclasses import dataclass
from typing import TYPE_CHECKING

from mpc_cover.service.protocol.decoding import Reason, RejectedError, decode_request
from mpc_cover.service.protocol.keys import Keys
from mpc_cover.service.protocol.messages import CommandName, CommandReply, encode

if TYPE_CHECKING:
    from mpc_cover.mission.load import Mission
    from mpc_cover.service.protocol.bus import Request, Transport
    from mpc_cover.service.protocol.messages import CommandRequest, Phase

URGENT = {CommandName.PAUSE, CommandName.ABORT}
"""Commands that are executed between two ticks of a flight: those to brake."""
DEPTH = 16
REMEMBERED = 64


@dataclass(frozen=True)
class Command:
    """A command with its request id; a retask has a `mission` as JSON."""

    name: CommandName
    request: str
    mission: str = ""


@dataclass(frozen=True)
class Decision:
    """The outcome of a command; `problems` are those of a mission."""

    accepted: bool = True
    text: str = "done"
    problems: tuple[str, ...] = ()


class CommandServer:
    """Receives requests at the start of a tick and answers them at its end.

    `identity` is that of the controller. Where messages are signed, a command must be for it, and new.

    Attributes
    ----------
    paused : whether the newest of pause and resume was pause.
    rejected : requests that were turned away, by reason.
    """

    def __init__(self, mission: Mission, transport: Transport, identity: str = "") -> None:
        self.paused = False
        self.rejected: Counter[Reason] = Counter()
        self._signed, self._identity = transport.signed, identity
        self._forgotten: set[str] = set()
        self._requests = transport.requests(Keys(mission.spec.name).command(), DEPTH)
        self._known: OrderedDict[str, tuple[CommandName, Decision]] = OrderedDict()
        self._open: list[tuple[Request, Command]] = []
        self._turned_away: list[RejectedError] = []

    def receive(self) -> list[Command]:
        """Return the new commands, in their order."""
        commands = []
        for request in self._requests.drain():
            name = request.key.rsplit("/", 1)[-1]
            try:
                asked = self._check(decode_request(request.payload))
            except RejectedError as error:
                self._turned_away.append(error)
                request.fail(str(error).encode())
                continue
            if name not in set(CommandName):
                request.fail(f"unknown command {name}: must be one of {', '.join(CommandName)}".encode())
                continue
            command = Command(CommandName(name), asked.request, asked.mission)
            self._open.append((request, command))
            if asked.request not in self._known:
                commands.append(command)
                self._remember(command)
        return commands

    def take_refused(self) -> list[RejectedError]:
        """Return why requests were turned away since last time."""
        refused = [*self._requests.take_refused(), *self._turned_away]
        self._turned_away = []
        self.rejected.update(error.reason for error in refused)
        return refused

    @property
    def waiting(self) -> bool:
        """Whether a command to brake waits to be received."""
        return any(key.rsplit("/", 1)[-1] in URGENT for key in self._requests.keys())  # noqa: SIM118 - no dict

    def decide(self, command: Command, decision: Decision) -> None:
        """Set the outcome of a command that was received; by default it is accepted."""
        self._known[command.request] = command.name, decision

    def answer(self, phase: Phase) -> None:
        """Reply to the commands that were received, now that they are executed."""
        for request, command in self._open:
            name, decision = self._known.get(command.request, (command.name, Decision()))
            reply = CommandReply(
                request=command.request,
                accepted=decision.accepted,
                phase=phase,
                text=f"{name}: {decision.text}"[:1000],
                problems=[problem[:1000] for problem in decision.problems[:1000]],
            )
            request.reply(encode(reply))
        self._open = []

    def _remember(self, command: Command) -> None:
        if command.name in {CommandName.PAUSE, CommandName.RESUME}:
            self.paused = command.name is CommandName.PAUSE
        self._known[command.request] = command.name, Decision()
        while len(self._known) > REMEMBERED:
            forgotten, _ = self._known.popitem(last=False)
            if self._signed:  # only operators can make this set grow
                self._forgotten.add(forgotten)

    def _check(self, asked: CommandRequest) -> CommandRequest:
        """Return a request that may be executed or answered again: where messages are signed, none is a replay."""
        if self._signed and asked.controller != self._identity:
            raise RejectedError(Reason.OTHER_CONTROLLER, f"for {asked.controller[:8] or 'none'}")
        if asked.request in self._forgotten:
            raise RejectedError(Reason.OLD, f"request {asked.request}")
        return asked
