"""The controllers that studies compare: by name, the missions that each can fly, and how it flies them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from mpc_cover.control.controller_name import ControllerName
from mpc_cover.control.factory import make_control_law, require_double
from mpc_cover.distributed.setup import check_flyable
from mpc_cover.errors import UserError
from mpc_cover.studies.flight import fly_by_controller, fly_without_controller
from mpc_cover.studies.sweep import SweepLaw, without_coordination

if TYPE_CHECKING:
    from collections.abc import Callable

    from mpc_cover.mission.load import Mission
    from mpc_cover.studies.flight import Flight

BACKEND = "native"
"""Default QP back-end; also given in the files of controllers that solve no QP."""


def _itself(mission: Mission) -> Mission:
    return mission


@dataclass(frozen=True)
class Controller:
    """A controller to compare.

    Attributes
    ----------
    fly : flies a mission as `flyable` returns it, with a back-end's name and a seed.
    check : raises `UserError` for such a mission, or a back-end's name, that `fly` could not start with.
    flyable : takes a mission and returns it as this controller can fly it: without the constraints that it ignores.
        The flight is still judged by the whole mission.
    plans_ahead : whether horizon and back-end matter to it; if not, it flies once for all of them.
    """

    fly: Callable[[Mission, str, int], Flight]
    check: Callable[[Mission, str], object]
    flyable: Callable[[Mission], Mission] = _itself
    plans_ahead: bool = False


def _fly_horizon(mission: Mission, backend: str, seed: int) -> Flight:
    return fly_by_controller(mission, make_control_law(mission, backend, seed), backend, seed)


def _check_horizon(mission: Mission, backend: str) -> None:
    make_control_law(mission, backend, seed=0)


def _fly_sweep(mission: Mission, backend: str, seed: int) -> Flight:
    return fly_by_controller(mission, SweepLaw(mission), backend, seed)


def _check_sweep(mission: Mission, backend: str) -> None:  # noqa: ARG001 - as all are checked
    require_double(mission)
    SweepLaw(mission)


def _fly_potential(mission: Mission, backend: str, seed: int) -> Flight:  # noqa: ARG001 - as all are flown
    return fly_without_controller(mission, seed)


def _check_potential(mission: Mission, backend: str) -> None:  # noqa: ARG001 - as all are checked
    check_flyable(mission)


CONTROLLERS: dict[str, Controller] = {
    ControllerName.MPC: Controller(_fly_horizon, _check_horizon, plans_ahead=True),
    ControllerName.SWEEP: Controller(_fly_sweep, _check_sweep, flyable=without_coordination),
    ControllerName.POTENTIAL: Controller(_fly_potential, _check_potential),
}
"""By `ControllerName`."""


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


def run_flight(mission: Mission, controller: str, *, backend: str = BACKEND, seed: int = 0) -> Flight:
    """Fly a mission by a controller of `CONTROLLERS`; its trajectory carries the whole mission.

    The same mission, controller, back-end and seed give the same trajectory to the last bit.

    Raises
    ------
    UserError
        An unknown controller, or one that cannot fly this mission.
    """
    entry = controller_of(controller)
    flight = entry.fly(entry.flyable(mission), backend, seed)
    return replace(flight, trajectory=replace(flight.trajectory, mission=mission))


def check_flight(mission: Mission, controller: str, *, backend: str = BACKEND) -> None:
    """Check before the flight that `run_flight` can start; arguments and errors are the same."""
    entry = controller_of(controller)
    entry.check(entry.flyable(mission), backend)
