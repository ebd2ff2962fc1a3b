"""Who can be compared: a name for each controller, and how it is made."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from mpc_cover.errors import UserError
from mpc_cover.service.brain import make_brain

if TYPE_CHECKING:
    from collections.abc import Callable

    from mpc_cover.mission.load import Mission
    from mpc_cover.service.brain import Brain


@dataclass(frozen=True)
class Controller:
    """One entry.

    Attributes
    ----------
    make : takes the mission, a back-end's name and a seed.
    plans_ahead : whether horizon and back-end matter to it; if not, it flies once for all of them.
    """

    make: Callable[[Mission, str, int], Brain]
    plans_ahead: bool = False


def _sweep(mission: Mission, backend: str, seed: int) -> Brain:  # noqa: ARG001 - as all are made
    from mpc_cover.studies.sweep import SweepBrain  # noqa: PLC0415 - each controller brings its own imports

    brain: Brain = SweepBrain(mission)
    return brain


def _potential(mission: Mission, backend: str, seed: int) -> Brain:  # noqa: ARG001 - as all are made
    from mpc_cover.studies.potential_flight import PotentialBrain  # noqa: PLC0415 - likewise

    brain: Brain = PotentialBrain(mission, seed)
    return brain


CONTROLLERS = {
    "mpc": Controller(make_brain, plans_ahead=True),
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
