"""What a controller keeps for its successor."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray
    from mpc_cover.mission.load import Mission


@dataclass(frozen=True, eq=False)
class Snapshot:
    """How far a mission is.

    Attributes
    ----------
    mission_time_s : [s].
    map : the arrays of what was measured, see `information.demand.FlownMap.state`.
    finished : whether it is over.
    origins : for each agent's instance, where mission time 0 lies on its clock [s]; empty while nobody flies.
    lost : where agents rest that were lost, (d,) [m], by id.
    heard : for each agent's instance, the number of the last state that the map knows.
    versions : fingerprints of what the mission was before, for the same fleet: its agents may know any of them.
    """

    mission_time_s: float
    map: dict[str, FloatArray]
    finished: bool = False
    origins: dict[str, float] = field(default_factory=dict)
    lost: dict[str, list[float]] = field(default_factory=dict)
    heard: dict[str, int] = field(default_factory=dict)
    versions: list[str] = field(default_factory=list)


class CheckpointStore(Protocol):
    """Keeps the newest snapshot."""

    def save(self, snapshot: Snapshot, *, now: bool) -> str | None:
        """Keep it, at once or when it is due; return what went wrong, if anything: the control goes on."""
        ...

    def take_up(self, mission: Mission) -> None:
        """Keep snapshots of another version of the mission from now on."""
        ...

    def close(self) -> None:
        """Let go of the place where it is kept."""
        ...


class NoCheckpoints:
    """Keeps nothing: simulations."""

    def save(self, snapshot: Snapshot, *, now: bool) -> str | None:  # noqa: ARG002 - nothing is kept
        """Do nothing."""
        return None

    def take_up(self, mission: Mission) -> None:
        """Do nothing."""

    def close(self) -> None:
        """Do nothing."""
