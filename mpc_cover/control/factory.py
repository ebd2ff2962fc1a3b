"""Factory of the control law; imports the law and its solvers only when it is called."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from mpc_cover.errors import UserError
from mpc_cover.mission.config import Dynamics

if TYPE_CHECKING:
    from mpc_cover.control.control_law import ControlLaw
    from mpc_cover.mission.load import Mission


def require_double(mission: Mission) -> None:
    """Reject missions with single integrators, for which the planner has no model.

    Raises
    ------
    UserError
        The mission's agents are single integrators.
    """
    if mission.spec.fleet.dynamics is Dynamics.SINGLE:
        right = "plans are for double integrators: fly it with --controller potential"
        raise UserError(f"mission {mission.spec.name}: fleet.dynamics single: {right}")


def make_control_law(mission: Mission, backend: str, seed: int) -> ControlLaw:
    """Return the receding-horizon control law of a mission, with a QP back-end by name and a seed.

    It decides in the mission's local frame.

    Raises
    ------
    UserError
        The mission's agents are single integrators.
    """
    require_double(mission)
    from mpc_cover.control.local_frame_law import LocalFrameLaw  # noqa: PLC0415 - as below
    from mpc_cover.control.receding_horizon import RecedingHorizon  # noqa: PLC0415 - imports the solvers

    return LocalFrameLaw(mission, partial(RecedingHorizon, backend=backend, seed=seed))
