"""A control law that decides in the mission's local frame, for a fleet whose states are in metres."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from mpc_cover.control.control_law import ImprovesWhenIdle
from mpc_cover.model.cell_blocks import CellBlocks
from mpc_cover.model.local_frame import LocalFrame

if TYPE_CHECKING:
    from collections.abc import Callable

    from mpc_cover.arrays import BoolArray, FloatArray
    from mpc_cover.control.control_law import ControlLaw, Proposal
    from mpc_cover.control.recovery import Mode
    from mpc_cover.information.demand import Demand, DemandMap
    from mpc_cover.mission.load import Mission
    from mpc_cover.model.fleet_state import FleetState
    from mpc_cover.model.trajectory import Trajectory
    from mpc_cover.planning.budget import Budget


class LocalFrameLaw:
    """Converts states and maps for a law that decides in local units, and its proposals back to metres.

    Parameters
    ----------
    mission : in metres.
    make_law : returns the law for the mission in local units.
    """

    def __init__(self, mission: Mission, make_law: Callable[[Mission], ControlLaw]) -> None:
        self._blocks = CellBlocks.of(mission)
        planned = mission if self._blocks is None else self._blocks.mission(mission)
        self._frame = LocalFrame.of(mission)
        self._law = make_law(self._frame.mission(planned))
        self.tolerates_losses = self._law.tolerates_losses
        self._proposed: tuple[Trajectory, Trajectory] | None = None

    @property
    def mode(self) -> Mode:
        """The mode of the law."""
        return self._law.mode

    def step(self, state: FleetState, coverage: DemandMap, budget: Budget) -> Proposal:
        """Return the law's proposal, from exactly the given state on."""
        local = _LocalMap(coverage, self._frame, self._blocks)
        proposal = self._law.step(self._frame.state(state), local, budget)
        metric = self._frame.metric(proposal.trajectory, state.position, state.velocity)
        self._proposed = metric, proposal.trajectory
        return replace(proposal, trajectory=metric)

    def improve(self, budget: Budget) -> bool:
        """Let the law improve its plan between two steps; return whether more time may help."""
        return isinstance(self._law, ImprovesWhenIdle) and self._law.improve(budget)

    def published(self, trajectory: Trajectory) -> None:
        """Notify the law of what was sent."""
        own = self._proposed is not None and self._proposed[0] is trajectory
        self._law.published(self._proposed[1] if own and self._proposed else self._frame.local(trajectory))


@dataclass(frozen=True, eq=False)
class _LocalMap:
    """A map that is asked for positions in local units, and answers for blocks of cells."""

    map: DemandMap
    frame: LocalFrame
    blocks: CellBlocks | None

    @property
    def endless(self) -> bool:
        return self.map.endless

    @property
    def owed(self) -> BoolArray:
        return self.map.owed if self.blocks is None else self.blocks.any(self.map.owed)

    @property
    def residual(self) -> FloatArray:
        return self.map.residual if self.blocks is None else self.blocks.most(self.map.residual)

    @property
    def complete(self) -> bool:
        return self.map.complete

    def demand(self, time_s: float, position: FloatArray) -> Demand:
        demand = self.map.demand(time_s, self._metric(position))
        return demand if self.blocks is None else demand.of_blocks(self.blocks)

    def begin_lap(self, time_s: float, position: FloatArray) -> None:
        self.map.begin_lap(time_s, self._metric(position))

    def _metric(self, position: FloatArray) -> FloatArray:
        return self.frame.origin + self.frame.length * position
