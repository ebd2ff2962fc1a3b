"""The messages on the wire: msgspec Structs as JSON, with a schema version in each.

SI units; map frame east-north-up. Time stamps are seconds of a monotonic clock whose owner is named
beside each; wall clocks are never sent.
"""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated

import msgspec

SCHEMA_VERSION = 1

Count = Annotated[int, msgspec.Meta(ge=0, le=2**53)]
Text = Annotated[str, msgspec.Meta(max_length=1000)]
Id = Annotated[str, msgspec.Meta(min_length=1, max_length=64)]
Vector = Annotated[list[float], msgspec.Meta(min_length=1, max_length=3)]
MissionText = Annotated[str, msgspec.Meta(max_length=1 << 20)]
Problems = Annotated[list[Text], msgspec.Meta(max_length=1000)]
Samples = Annotated[list[Vector], msgspec.Meta(min_length=1, max_length=1001)]


class Phase(StrEnum):
    """The phase of a mission."""

    WAITING = "waiting"
    PLANNING = "planning"
    FLYING = "flying"
    COMPLETE = "complete"
    FAILED = "failed"
    STOPPED = "stopped"


class CommandName(StrEnum):
    """The commands to the controller."""

    PAUSE = "pause"
    """Brake now, and wait at rest for `resume`."""
    RESUME = "resume"
    ABORT = "abort"
    """Brake now, and end."""
    FINISH = "finish"
    """Fly the present plan to its end, and end."""
    RETASK = "retask"


class PlanRef(msgspec.Struct, frozen=True):
    """Which plan: the controller's epoch and its sequence number."""

    epoch: Count
    seq: Count


class Message(msgspec.Struct, frozen=True, kw_only=True):
    """Base of all messages; unknown fields are ignored, so that a later version may add some."""

    schema: int = SCHEMA_VERSION


class State(Message, frozen=True, kw_only=True):
    """An agent's measured state at `time_s` of its own clock.

    `position` and `velocity` are (d,) [m], [m/s]. `plan` is the plan being flown, `next_plan` the one that
    it will switch to; `at_rest` says that it stands still and has nothing left to fly. `speed` is how many
    seconds of its clock pass in a second, `mission` the fingerprint of its mission. A disturbed agent also
    reports the state that it tracks: `reference_position` and `reference_velocity`. `refused` is the plan
    that it rejected last, unless it has accepted one since. `epoch` is the highest epoch of which it has accepted a
    plan, and `controller` whose that was: it rejects plans of lower ones, and of others of the same. `heard` is the
    process of the controller that it has heard last: what was recorded before that one began cannot name it.
    """

    agent: Id
    instance: Id
    seq: Count
    time_s: float
    position: Vector
    velocity: Vector
    plan: PlanRef | None = None
    next_plan: PlanRef | None = None
    at_rest: bool = False
    speed: float = 1.0
    mission: Id = "unknown"
    reference_position: Vector | None = None
    reference_velocity: Vector | None = None
    refused: PlanRef | None = None
    epoch: Count = 0
    controller: Annotated[str, msgspec.Meta(max_length=64)] = ""
    heard: Text = ""


class PlanMessage(Message, frozen=True, kw_only=True):
    """A plan of one agent over the whole horizon; it ends at rest.

    `start_s` and `valid_until_s` are in the clock of that agent's instance: a plan that was not received
    by `valid_until_s` is stale. `position`, `velocity` are (N+1, d) [m], [m/s]; `input` (N, d) [m/s^2].
    """

    epoch: Count
    controller: Id
    seq: Count
    agent: Id
    instance: Id
    start_s: float
    valid_until_s: float
    period_s: float
    position: Samples
    velocity: Samples
    input: Samples

    @property
    def ref(self) -> PlanRef:
        """The id under which an agent reports this plan."""
        return PlanRef(self.epoch, self.seq)


class Status(Message, frozen=True, kw_only=True):
    """The controller's heartbeat, published at the end of a tick."""

    controller: Id
    epoch: Count
    seq: Count
    phase: Phase
    mission_time_s: float
    covered_count: Count
    cell_count: Count
    steps: Count = 0
    step_ms: float = 0.0
    plan_source: Text = ""
    reason: Text = ""
    deadline_misses: Count = 0
    skipped_ticks: Count = 0
    rejected: Count = 0
    callback_errors: Count = 0
    present: list[Id] = []
    lost: list[Id] = []
    text: Text = ""
    instances: dict[str, str] = {}
    """Which process of each agent the controller listens to, by agent id."""
    standing: dict[str, Vector] = {}
    """Where agents stand, or come to rest whose process has died, by id [m]: a simulated vehicle starts anew there."""
    still_in_s: dict[str, float] = {}
    """In how many seconds of the controller's clock those come to rest that do not stand yet."""


class MapMessage(Message, frozen=True, kw_only=True):
    """The cells that are covered: `bits` is hexadecimal, the first cell the highest bit of the first byte."""

    controller: Id
    epoch: Count
    mission_time_s: float
    cell_count: Count
    covered_count: Count
    bits: str


class Event(Message, frozen=True, kw_only=True):
    """An event of interest to users; `time_s` is in the source's own clock."""

    source: Id
    seq: Count
    time_s: float
    kind: Id
    text: Text


class CommandRequest(Message, frozen=True, kw_only=True):
    """A request for the command of its key, a `CommandName`; the request id makes repeating it harmless.

    `mission` is, for a retask, the new version of the mission as JSON. `controller` is the controller process that it
    is for: one that believes signatures alone turns away what was meant for another, as that may be a repeat.
    """

    request: Id
    text: Text = ""
    mission: MissionText = ""
    controller: Text = ""


class CommandReply(Message, frozen=True, kw_only=True):
    """The outcome of a command; `problems` are those of a mission, each with its path."""

    request: Id
    accepted: bool
    phase: Phase
    text: Text = ""
    problems: Problems = []


def encode(message: Message) -> bytes:
    """Return the message as JSON."""
    return msgspec.json.encode(message)
