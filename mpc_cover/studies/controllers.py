"""Who can be compared: a name for each controller, and how it is made."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from mpc_cover.control.control_law import make_control_law
from mpc_cover.errors import UserError

if TYPE_CHECKING:
    from collections.abc import Callable

    from mpc_cover.control.control_law import ControlLaw
    from mpc_cover.mission.load import Mission


@dataclass(frozen=True)
class Controller:
    """One entry.

    Attributes
    ----------
    make : takes the mission, a back-end's name and a seed.
    plans_ahead : whether horizon and back-end matter to it; if not, it flies once for all of them.
    """

    make: Callable[[Mission, str, int], ControlLaw]
    plans_ahead: bool = False


def _sweep(mission: Mission, backend: str, seed: int) -> ControlLaw:  # noqa: ARG001 - as all are made
    from mpc_cover.studies.sweep import SweepLaw  # noqa: PLC0415 - each controller brings its own imports

    law: ControlLaw = SweepLaw(mission)
    return law


def _potential(mission: Mission, backend: str, seed: int) -> ControlLaw:  # noqa: ARG001 - as all are made
    from mpc_cover.studies.potential_flight import PotentialFleetLaw  # noqa: PLC0415 - likewise

    law: ControlLaw = PotentialFleetLaw(mission, seed)
    return law


CONTROLLERS = {
    "mpc": Controller(make_control_law, plans_ahead=True),
    "sweep": Controller(_sweep),
    "potential": Controller(_potential),
}
"""mpc: the receding horizon. sweep: a static boustrophedon partition. potential: the thesis's distributed law."""


def controller_of(name: str) -> Controller:
    """Return a controller by name.

    Raises
    ------
    UserError
        There is none of this name.
    """
    if name not in CONTROLLERS:
        raise UserError(f"--controllers {name}: is none: must be among {', '.join(CONTROLLERS)}")
    return CONTROLLERS[name]
