"""The interface of a control law: the fleet's state in, a proposed trajectory out."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING, Protocol, runtime_checkable

if TYPE_CHECKING:
    from mpc_cover.control.recovery import Mode
    from mpc_cover.information.demand import DemandMap
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
    """The trajectory that a control law proposes.

    Attributes
    ----------
    trajectory : of the whole fleet, from the state's time on, ending at rest. It is not trusted: the safety filter
        decides whether it is sent.
    source : how it was obtained.
    reason : what was done, or why nothing better was found, in words.
    eased : whether the fleet is so tight that its plans do not keep apart from all that others may hold.
    """

    trajectory: Trajectory
    source: PlanSource = PlanSource.NEW
    reason: str = ""
    eased: bool = False


class ControlLaw(Protocol):
    """See `control.receding_horizon.RecedingHorizon`.

    Attributes
    ----------
    tolerates_losses : whether it continues without lost agents; else the fleet waits for them at rest.
    """

    tolerates_losses: bool

    @property
    def mode(self) -> Mode:
        """The present mode; `REPLAN_AT_REST` requests a step while the whole fleet is at rest."""
        ...

    def step(self, state: FleetState, coverage: DemandMap, budget: Budget) -> Proposal:
        """Return a proposal from a state on, for the demand of `coverage`; thoroughly searched when `state.settled`."""
        ...

    def published(self, trajectory: Trajectory) -> None:
        """Notify the law that a proposed trajectory was sent; only trajectories notified here become the incumbent."""
        ...


@runtime_checkable
class ImprovesWhenIdle(Protocol):
    """A control law that can use the time between two steps."""

    def improve(self, budget: Budget) -> bool:
        """Search on for better plans; return whether more time may help. Nothing is sent before the next step."""
        ...
