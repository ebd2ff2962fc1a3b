"""All key expressions in one place."""

from __future__ import annotations

from dataclasses import dataclass

ANY = "*"
"""Stands for any one agent or command in a pattern."""


@dataclass(frozen=True)
class Keys:
    """The keys of one mission."""

    mission: str

    @property
    def root(self) -> str:
        """Prefix of every key."""
        return f"cover/{self.mission}"

    def state(self, agent: str = ANY) -> str:
        """Return the key of an agent's measured state."""
        return f"{self.root}/agent/{agent}/state"

    def plan(self, agent: str = ANY) -> str:
        """Return the key of the plan that an agent is to fly."""
        return f"{self.root}/agent/{agent}/plan"

    def agent_event(self, agent: str = ANY) -> str:
        """Return the key of an agent's events."""
        return f"{self.root}/agent/{agent}/event"

    def agent_alive(self, agent: str = ANY, instance: str = ANY) -> str:
        """Return the key of the liveliness token of one process of an agent."""
        return f"{self.root}/agent/{agent}/alive/{instance}"

    def hello(self, agent: str = ANY) -> str:
        """Return the key on which an agent of the distributed law announces itself, before the start."""
        return f"{self.root}/agent/{agent}/hello"

    def word(self, agent: str = ANY) -> str:
        """Return the key on which an agent of the distributed law broadcasts to agents in range."""
        return f"{self.root}/agent/{agent}/word"

    @property
    def status(self) -> str:
        """The controller's heartbeat."""
        return f"{self.root}/ctl/status"

    @property
    def map(self) -> str:
        """The coverage map, published and available on request."""
        return f"{self.root}/ctl/map"

    @property
    def controller_event(self) -> str:
        """The controller's events."""
        return f"{self.root}/ctl/event"

    @property
    def controller_alive(self) -> str:
        """The controller's liveliness token."""
        return f"{self.root}/ctl/alive"

    def controller_instance(self, identity: str = ANY) -> str:
        """Return the key of the liveliness token of one controller process."""
        return f"{self.controller_alive}/{identity}"

    def command(self, name: str = ANY) -> str:
        """Return the key of a command: pause, resume, abort, finish, retask."""
        return f"{self.root}/ctl/cmd/{name}"


def agent_of(key: str) -> str:
    """Return the agent id in one of the agent keys, or an empty string."""
    chunks = key.split("/")
    return chunks[3] if len(chunks) in {5, 6} and chunks[2] == "agent" else ""  # cover/m/agent/id/what/instance


def is_command(key: str) -> bool:
    """Return whether a key is that of a command."""
    return key.split("/")[2:4] == ["ctl", "cmd"]


def matches(pattern: str, key: str) -> bool:
    """Return whether a key matches a pattern in which `*` stands for one chunk."""
    wanted, chunks = pattern.split("/"), key.split("/")
    return len(wanted) == len(chunks) and all(w in (ANY, c) for w, c in zip(wanted, chunks, strict=True))


def mission_of(key: str) -> str:
    """Return the name of the mission in one of the keys, or an empty string."""
    chunks = key.split("/")
    return chunks[1] if len(chunks) > 2 and chunks[0] == "cover" else ""  # noqa: PLR2004 - cover/m/what
