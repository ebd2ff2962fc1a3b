"""The controller's epoch against those that the agents have seen: whose fleet it is.

An agent takes no plan of a lower epoch than it has seen. A controller that starts on a new machine, or without its
state directory, would send plans that all are rejected, for ever; so it listens first, and takes the highest epoch seen
plus one. If an agent that has accepted its plans goes over to a higher epoch, another controller has taken over, and
this one withdraws; so it does where it sees another one that has a higher epoch.
"""

from __future__ import annotations

from enum import Enum, auto
from typing import TYPE_CHECKING, NamedTuple

from mpc_cover.service.agent.plan_filter import EPOCH_JUMP
from mpc_cover.service.controller.state_directory import EPOCH_MAX
from mpc_cover.service.protocol.keys import Keys

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Sequence

    from mpc_cover.service.protocol.bus import Transport
    from mpc_cover.service.protocol.messages import State


class Claim(Enum):
    """What to do about a higher epoch."""

    TAKE = auto()
    """Go on as `epoch`: nobody else is here."""
    WITHDRAW = auto()
    """A controller of `epoch` has taken over."""


class Verdict(NamedTuple):
    """What to do, and the epoch that it is about."""

    claim: Claim
    epoch: int


class EpochWatch:
    """Compares the controller's epoch with those that agents report.

    Attributes
    ----------
    epoch : of this controller.
    doubted : the epochs that are not believed, by agent.
    """

    def __init__(self, mission: str, transport: Transport, identity: str, epoch: int) -> None:
        self.epoch = epoch
        self.doubted: dict[str, int] = {}
        self._identity = identity
        self._own = Keys(mission).controller_instance(identity)
        self._controllers = transport.presence(Keys(mission).controller_instance())
        self._followers: set[str] = set()

    def look(self, states: Sequence[State]) -> Verdict | None:
        """Return what to do about the newest state of each agent; None where this controller's epoch is the highest."""
        self._followers |= {state.instance for state in states if self._follows(state)}
        seen = {state.agent: self._seen(state) for state in states}
        believed = believed_epochs(seen, self.epoch)
        self.doubted = {name: epoch for name, epoch in seen.items() if name not in believed}
        higher = [state for state in states if state.agent in believed and self._outranks(state)]
        if not higher:
            return None
        newest = max(self._seen(state) for state in higher)
        gone_over = any(state.instance in self._followers for state in higher)
        if gone_over or self._others_alive():
            return Verdict(Claim.WITHDRAW, newest)
        return Verdict(Claim.TAKE, newest + 1)

    def take(self, epoch: int) -> None:
        """Go on as this epoch."""
        self.epoch = epoch
        self._followers.clear()

    def doubts(self, lost: Collection[str]) -> list[str]:
        """Return, for users, which agents that are not lost report an epoch that is not believed."""
        return [
            f"{name} says that it has seen epoch {epoch}, as nobody else has: restart it, as it takes no plan of others"
            for name, epoch in self.doubted.items()
            if name not in lost
        ]

    def _follows(self, state: State) -> bool:
        return state.epoch == self.epoch and state.controller == self._identity

    def _outranks(self, state: State) -> bool:
        """Return whether an agent takes no plan of this controller: of a higher epoch, or of another of the same."""
        seen = self._seen(state)
        twin = state.epoch == self.epoch and state.controller not in {"", self._identity}
        return seen > self.epoch or (seen == self.epoch and twin)

    @staticmethod
    def _seen(state: State) -> int:
        """Return the highest epoch that an agent reports; those of an earlier version report only what they fly."""
        flown = (ref.epoch for ref in (state.plan, state.next_plan) if ref is not None)
        return max([state.epoch, *flown])

    def _others_alive(self) -> bool:
        return bool(self._controllers.alive() - {self._own})


def believed_epochs(seen: dict[str, int], own: int) -> set[str]:
    """Return the agents whose epochs are believed: no farther ahead of all others than a million restarts.

    One agent that reports nonsense, or a stranger in its name, must not drive the epochs of a fleet to their end. A
    jump is believed from two agents at least.
    """
    believed: set[str] = set()
    for name, epoch in seen.items():
        others: Iterable[int] = (other for who, other in seen.items() if who != name)
        if epoch <= min(max([own, *others]) + EPOCH_JUMP, EPOCH_MAX):
            believed.add(name)
    return believed
