"""The faults of a simulated flight: what happens to whom, from when, for how long."""

from __future__ import annotations

from enum import StrEnum

import msgspec

LASTING_S = 1000.0
"""Faults that last longer do so for the whole flight [s]; a plain choice."""
CONTROLLER = "controller"
"""Name of the controller's process among those that faults strike; agents go by their ids."""


class FaultKind(StrEnum):
    """The kinds of faults that `mpc-cover torture --faults` names."""

    LOSS = "loss"
    """Messages are lost, each independently of the others."""
    BURSTS = "bursts"
    """All states or plans of some agents are lost for seconds."""
    CUTS = "cuts"
    """One process is cut off, both ways; it may keep its token, and messages may wait instead of being lost."""
    DELAY = "delay"
    """Messages are delayed, by constant and random times, in their order."""
    REORDER = "reorder"
    """Messages overtake each other."""
    DUPLICATES = "duplicates"
    """Messages arrive several times, at once or later."""
    CLOCKS = "clocks"
    """Wall clocks step by an hour, and monotonic clocks drift."""
    DEATHS = "deaths"
    """A process dies and does not come back."""
    STOPS = "stops"
    """A process is stopped (SIGSTOP) and continued: nothing of it runs, and messages wait for it, or are lost."""
    RESTARTS = "restarts"
    """A process dies and is started again; an agent where it stands, a controller from its checkpoint."""
    TAKEOVERS = "takeovers"
    """The controller is stopped, another one takes over from what it kept, and the first is continued."""
    SLOW = "slow"
    """A process runs late at each of its ticks."""
    FROZEN = "frozen"
    """An agent reports one place while it flies on."""
    TWINS = "twins"
    """A second process says to be an agent that is there already."""
    SOLVER = "solver"
    """The control law raises, proposes nonsense or a collision, finds nothing, or takes too long."""
    DISK = "disk"
    """Checkpoints cannot be written, or were torn when the controller died."""


LINK_KINDS = frozenset(
    {
        FaultKind.BURSTS,
        FaultKind.CUTS,
        FaultKind.DEATHS,
        FaultKind.STOPS,
        FaultKind.RESTARTS,
        FaultKind.TAKEOVERS,
        FaultKind.FROZEN,
        FaultKind.TWINS,
    }
)
"""Kinds while which somebody is cut off, or is not where it says: no connectivity is asked for meanwhile."""


class Fault(msgspec.Struct, frozen=True):
    """One fault.

    Attributes
    ----------
    kind : what happens.
    start_s, duration_s : when, in seconds of the virtual time since the start of the simulation, and for how long;
        a duration of zero is an instant.
    targets : names of the processes that it strikes; empty for all.
    share : the probability of a loss or a duplicate, where there is one.
    delay_s, jitter_s : constant and random part of delays [s]; of a step of a clock, by how much.
    way : which messages: "state", "plan" or "both"; of a solver or a disk, what fails and how.
    held : whether messages wait instead of being lost.
    keeps_token : whether the liveliness tokens stay although nothing is heard.
    """

    kind: FaultKind
    start_s: float
    duration_s: float = 0.0
    targets: tuple[str, ...] = ()
    share: float = 1.0
    delay_s: float = 0.0
    jitter_s: float = 0.0
    way: str = "both"
    held: bool = False
    keeps_token: bool = False

    @property
    def end_s(self) -> float:
        """When it is over [s]."""
        return self.start_s + self.duration_s

    def on(self, time_s: float) -> bool:
        """Return whether it lasts at a time [s]."""
        return self.start_s <= time_s < self.end_s

    def strikes(self, name: str) -> bool:
        """Return whether a process is among its targets."""
        return not self.targets or name in self.targets

    @property
    def text(self) -> str:
        """The fault in a line, for people."""
        whom = ", ".join(self.targets) or "everyone"
        parts = [f"{self.kind} of {whom} at {self.start_s:.2f} s"]
        if self.duration_s > LASTING_S:
            parts.append("from then on")
        elif self.duration_s:
            parts.append(f"for {self.duration_s:.2f} s")
        if self.way != "both":
            parts.append(self.way)
        if self.share < 1.0:
            parts.append(f"share {self.share:.2f}")
        if self.delay_s or self.jitter_s:
            parts.append(f"{self.delay_s:.3f} + {self.jitter_s:.3f} s")
        parts += ["messages wait"] * self.held + ["keeps its token"] * self.keeps_token
        return ", ".join(parts)
