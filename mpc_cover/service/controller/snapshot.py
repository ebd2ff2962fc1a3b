"""Snapshots of a mission's progress, from which a later controller process resumes."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray
    from mpc_cover.mission.load import Mission


@dataclass(frozen=True, eq=False)
class Snapshot:
    """The progress of a mission.

    Attributes
    ----------
    mission_time_s : [s].
    map : the arrays of what was measured, see `information.demand.FlownMap.state`.
    finished : whether it is over.
    origins : for each agent's instance, mission time 0 by its clock [s]; empty while no mission is flown.
    lost : where lost agents rest, (d,) [m], by id.
    heard : for each agent's instance, the number of the last state in the map.
    versions : fingerprints of earlier versions of the mission for the same fleet: its agents may have any of them.
    epoch : of the controller that took it.
    """

    mission_time_s: float
    map: dict[str, FloatArray]
    finished: bool = False
    origins: dict[str, float] = field(default_factory=dict)
    lost: dict[str, list[float]] = field(default_factory=dict)
    heard: dict[str, int] = field(default_factory=dict)
    versions: list[str] = field(default_factory=list)
    epoch: int = 0


class CheckpointStore(Protocol):
    """Keeps the newest snapshot."""

    def save(self, snapshot: Snapshot, *, now: bool) -> str | None:
        """Keep it, at once or when it is due; return an error message, if any: control goes on."""
        ...

    def set_mission(self, mission: Mission) -> None:
        """Keep snapshots of another version of the mission from now on."""
        ...

    def close(self) -> None:
        """Release the storage."""
        ...


class NoCheckpoints:
    """Keeps no snapshots, for simulations."""

    def save(self, snapshot: Snapshot, *, now: bool) -> str | None:  # noqa: ARG002 - nothing is kept
        """Do nothing."""
        return None

    def set_mission(self, mission: Mission) -> None:
        """Do nothing."""

    def close(self) -> None:
        """Do nothing."""
