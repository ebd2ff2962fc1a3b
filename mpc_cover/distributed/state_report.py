"""The state report, which agents of the distributed law send each other."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class StateReport:
    """An agent's state at a sample: what is sent, and relayed.

    Attributes
    ----------
    agent : index in the fleet.
    sample : 0, 1, ...
    time_s : mission time [s].
    position, velocity : (d,) [m], [m/s].
    heard : the agents whose state of the sample before this one knew when it decided then.
    promised : whether the agent may still choose otherwise: a state announced before it is acted upon.
    looked : (d,) [m] where the agent has measured since its report before; None for nowhere. An agent that reports a
        sample ahead of time has not measured there yet.
    looked_s : when, mission time [s].
    complete : whether by its own map nothing is owed.
    readings : (n,) what was read there of each (magnitude, cell) in range, in their order; None where maps need none.
    """

    agent: int
    sample: int
    time_s: float
    position: FloatArray
    velocity: FloatArray
    heard: frozenset[int] = frozenset()
    promised: bool = False
    looked: FloatArray | None = None
    looked_s: float = 0.0
    complete: bool = False
    readings: FloatArray | None = None
