"""The controller's brain as the service sees it: predicted states in, a verified plan of the fleet out."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol, runtime_checkable

from mpc_cover.errors import UserError

if TYPE_CHECKING:
    from collections.abc import Mapping
    from enum import Enum

    from mpc_cover.arrays import BoolArray, FloatArray
    from mpc_cover.information.demand import FlownMap
    from mpc_cover.mission.load import Mission
    from mpc_cover.model.trajectory import Trajectory


class StepOutcome(Protocol):
    """What a step gives: a plan that is safe to fly, and which rung of the ladder it stands on."""

    @property
    def plan(self) -> Trajectory:
        """The whole fleet's plan, at rest at its end."""
        ...

    @property
    def plan_source(self) -> Enum:
        """Which rung of the ladder."""
        ...

    @property
    def reason(self) -> str:
        """Why not the rung above."""
        ...

    @property
    def computing_time_s(self) -> float:
        """Time that the step took [s]."""
        ...

    @property
    def deadline_missed(self) -> bool:
        """Whether time ran out."""
        ...


class ControlLaw(Protocol):
    """See `control.receding_horizon.RecedingHorizon`; tests hand in simpler ones."""

    coverage: FlownMap

    def prepare(
        self, position: FloatArray, velocity: FloatArray, start_time: float, *, deadline: float | None
    ) -> StepOutcome:
        """Plan thoroughly while everyone is at rest; `deadline` is on `time.perf_counter`."""
        ...

    def step(
        self, position: FloatArray, velocity: FloatArray, start_time: float, *, deadline: float | None
    ) -> StepOutcome:
        """Return a plan from this (m, d) state at `start_time`."""
        ...


@runtime_checkable
class ToleratesLosses(Protocol):
    """A brain that can do without some agents."""

    def set_lost(self, lost: BoolArray) -> None:
        """Plan without those marked (m,): from now on their rows of a state say where they come to rest."""
        ...


@runtime_checkable
class AvoidsObstacles(Protocol):
    """A brain that keeps clear of the lost while they still move."""

    def set_obstacles(self, obstacles: Mapping[int, Trajectory]) -> None:
        """Take note of how those who are lost come to rest, by number; whoever is not in it rests already."""
        ...


@runtime_checkable
class KnowsReachability(Protocol):
    """A brain that knows what nobody can measure any more."""

    @property
    def unreachable(self) -> BoolArray:
        """(J, K): what is owed, but cannot be measured by any of those who are left."""
        ...


@runtime_checkable
class ReplansAtRest(Protocol):
    """A brain that knows when a step is too short for what it has to plan."""

    @property
    def wants_replan_at_rest(self) -> bool:
        """Whether it is worth while to stop and plan thoroughly."""
        ...


@runtime_checkable
class LimitsSpeed(Protocol):
    """A brain that can plan for an agent that is slower than its mission says."""

    def limit_speed(self, index: int, part: float) -> None:
        """Ask agent number `index` for this part of its speed limit at most."""
        ...


def require_double(mission: Mission) -> None:
    """Refuse single integrators, for whom nobody plans.

    Raises
    ------
    UserError
        The mission's agents are single integrators.
    """
    if mission.spec.fleet.dynamics == "single":
        right = "plans are for double integrators: fly it with --controller potential"
        raise UserError(f"mission {mission.spec.name}: fleet.dynamics single: {right}")


def make_control_law(mission: Mission, backend: str, seed: int) -> ControlLaw:
    """Return the receding-horizon controller; importing it takes as long as its solvers take.

    Raises
    ------
    UserError
        The mission's agents are single integrators.
    """
    require_double(mission)
    from mpc_cover.control.receding_horizon import RecedingHorizon  # noqa: PLC0415 - heavy, agents never need it

    law: ControlLaw = RecedingHorizon(mission, backend=backend, seed=seed)
    return law
