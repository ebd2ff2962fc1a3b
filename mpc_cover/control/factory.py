"""Makes the control law of a mission; importing the law itself takes as long as its solvers take."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mpc_cover.errors import UserError
from mpc_cover.mission.config import Dynamics

if TYPE_CHECKING:
    from mpc_cover.control.control_law import ControlLaw
    from mpc_cover.mission.load import Mission


def require_double(mission: Mission) -> None:
    """Refuse single integrators, for whom nobody plans.

    Raises
    ------
    UserError
        The mission's agents are single integrators.
    """
    if mission.spec.fleet.dynamics is Dynamics.SINGLE:
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

    return RecedingHorizon(mission, backend=backend, seed=seed)
