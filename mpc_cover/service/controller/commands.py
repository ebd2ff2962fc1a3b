"""Commands to the controller: pause, resume, abort; a repeated request id gets the same reply."""

from __future__ import annotations

from collections import OrderedDict
from typing import TYPE_CHECKING

from mpc_cover.service.protocol.decoding import RejectedError, decode_request
from mpc_cover.service.protocol.keys import Keys
from mpc_cover.service.protocol.messages import CommandReply, encode

if TYPE_CHECKING:
    from mpc_cover.mission.load import Mission
    from mpc_cover.service.protocol.bus import Request, Transport
    from mpc_cover.service.protocol.messages import Phase

COMMANDS = ("pause", "resume", "abort")
DEPTH = 16
REMEMBERED = 64


class CommandDesk:
    """Takes requests at the start of a tick and answers them at its end."""

    def __init__(self, mission: Mission, transport: Transport) -> None:
        self.paused = False
        self._requests = transport.requests(Keys(mission.spec.name).command(), DEPTH)
        self._known: OrderedDict[str, str] = OrderedDict()
        self._open: list[tuple[Request, str, str]] = []

    def take(self) -> list[str]:
        """Return the new commands, in their order."""
        commands = []
        for request in self._requests.drain():
            command = request.key.rsplit("/", 1)[-1]
            try:
                asked = decode_request(request.payload)
            except RejectedError as error:
                request.fail(str(error).encode())
                continue
            if command not in COMMANDS:
                request.fail(f"unknown command {command}: must be one of {', '.join(COMMANDS)}".encode())
                continue
            self._open.append((request, asked.request, command))
            if asked.request not in self._known:
                commands.append(command)
                self._remember(asked.request, command)
        return commands

    def answer(self, phase: Phase) -> None:
        """Reply to what was taken, now that it is done."""
        for request, name, command in self._open:
            text = f"{self._known.get(name, command)}: done"
            request.reply(encode(CommandReply(request=name, accepted=True, phase=phase, text=text)))
        self._open = []

    def _remember(self, request: str, command: str) -> None:
        self.paused = {"pause": True, "resume": False}.get(command, self.paused)
        self._known[request] = command
        while len(self._known) > REMEMBERED:
            self._known.popitem(last=False)
