"""mpc-cover: receding-horizon area coverage by a fleet of mobile sensors.

The public interface; every name is imported when it is first asked for, so that importing the package costs nothing:

>>> import mpc_cover
>>> plan = mpc_cover.plan("box-3", time_limit_s=10.0)
>>> mpc_cover.check(plan).holds
True

`load_mission`, `plan`, `simulate`, `check`, `plot`, `load_trajectory` and `save_trajectory` are functions; `Mission`,
`Trajectory`, `Recording`, `Report` and `SimulationResult` are what they take and return, `MotionVariables` what a
function of a user's own terms and constraints is given; `UserError` is what all of them raise for a mistake that the
caller can mend.
"""

from importlib import import_module as _import_module
from typing import TYPE_CHECKING

from mpc_cover.version import __version__

if TYPE_CHECKING:
    from mpc_cover.api import SimulationResult, check, load_mission, load_trajectory, plan, plot, simulate
    from mpc_cover.errors import UserError
    from mpc_cover.mission.load import Mission
    from mpc_cover.model.trajectory import Trajectory
    from mpc_cover.planning.cvxpy_extra.motion_variables import MotionVariables
    from mpc_cover.trajectory_file import Recording, save_trajectory
    from mpc_cover.verification.report import Report

__all__ = [
    "Mission",
    "MotionVariables",
    "Recording",
    "Report",
    "SimulationResult",
    "Trajectory",
    "UserError",
    "__version__",
    "check",
    "load_mission",
    "load_trajectory",
    "plan",
    "plot",
    "save_trajectory",
    "simulate",
]

if not TYPE_CHECKING:  # a type checker is to refuse names that there are not
    _ELSEWHERE = {
        "Mission": "mpc_cover.mission.load",
        "MotionVariables": "mpc_cover.planning.cvxpy_extra.motion_variables",
        "Recording": "mpc_cover.trajectory_file",
        "Report": "mpc_cover.verification.report",
        "Trajectory": "mpc_cover.model.trajectory",
        "UserError": "mpc_cover.errors",
        "save_trajectory": "mpc_cover.trajectory_file",
    }

    def __getattr__(name: str) -> object:
        """Import a public name from where it is."""
        if name not in __all__:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        found = getattr(_import_module(_ELSEWHERE.get(name, "mpc_cover.api")), name)
        globals()[name] = found
        return found

    def __dir__() -> list[str]:
        return sorted({*globals(), *__all__})
