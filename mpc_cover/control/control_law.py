"""What the controller needs of a control law: the state of the fleet in, a plan to be judged out."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from mpc_cover.control.recovery import Mode
    from mpc_cover.information.demand import FlownMap
    from mpc_cover.model.fleet_state import FleetState
    from mpc_cover.model.trajectory import Trajectory
    from mpc_cover.planning.budget import Budget


class PlanSource(Enum):
    """Where the plan of a step comes from, best first."""

    NEW = "a verified new plan"
    SHIFTED = "the previous plan, shifted"
    BRAKE = "braking to rest"
    REST = "at rest, nothing to do"


@dataclass(frozen=True, eq=False)
class Proposal:
    """What a control law would have the fleet fly.

    Attributes
    ----------
    trajectory : of the whole fleet, from the state's time on, ending at rest. Nothing is believed of it: the safety
        filter decides whether it is sent.
    source : where it comes from.
    reason : why it is no better, or what was done, in a sentence.
    """

    trajectory: Trajectory
    source: PlanSource = PlanSource.NEW
    reason: str = ""


class ControlLaw(Protocol):
    """See `control.receding_horizon.RecedingHorizon`.

    Attributes
    ----------
    tolerates_losses : whether it goes on without agents that are lost; else the fleet waits for them at rest.
    """

    tolerates_losses: bool

    @property
    def mode(self) -> Mode:
        """What it does with the fleet; `REPLAN_AT_REST` asks for a step while everyone is at rest."""
        ...

    def step(self, state: FleetState, coverage: FlownMap, budget: Budget) -> Proposal:
        """Return a plan from a state on, for what `coverage` says is owed; when `state.settled`, a thorough one."""
        ...

    def published(self, trajectory: Trajectory) -> None:
        """Learn that a proposed trajectory was sent to the fleet. What this is not told of is not flown."""
        ...
