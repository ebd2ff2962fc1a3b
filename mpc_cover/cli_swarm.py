"""What `demo`, `simulate` and `agent` do with `--controller potential`: no controller, each agent by itself."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from mpc_cover.errors import UserError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from rich.console import Console

    from mpc_cover.mission.load import Mission
    from mpc_cover.service.run.run_folder import RunFolder
    from mpc_cover.verification.summary import RunSummary

CONTROLLERS = ("mpc", "potential")


def flies_alone(controller: str, mission: Mission) -> bool:
    """Return whether it is the potential law that flies, for which nobody is in charge.

    Raises
    ------
    UserError
        There is no such controller, or it cannot fly the mission.
    """
    if controller not in CONTROLLERS:
        raise UserError(f"--controller {controller}: is none: must be one of {', '.join(CONTROLLERS)}")
    if controller == "potential":
        from mpc_cover.distributed.setup import check_flyable  # noqa: PLC0415 - others need not wait for it

        check_flyable(mission)
        return True
    from mpc_cover.control.control_law import require_double  # noqa: PLC0415 - likewise

    require_double(mission)
    return False


def demo(
    mission: Mission, folder: RunFolder, console: Console, *, seed: int, speed: float, deaths: Mapping[str, float]
) -> tuple[RunSummary | None, dict[str, Any], int]:
    """Fly with one process an agent; return the summary, what else there is to say, and the exit status."""
    from mpc_cover.service.run.demo import DemoOptions  # noqa: PLC0415 - every import here is one that others need not
    from mpc_cover.service.run.swarm_demo import run_swarm_demo  # noqa: PLC0415

    result = run_swarm_demo(mission, DemoOptions(seed=seed, speed=speed, deaths=deaths), folder, console)
    extra = {"folder": str(folder.path), "outcome": result.outcome, "exit_status": result.exit_status}
    return result.summary, {**extra, "controller": "potential", "lost": list(result.lost)}, result.exit_status


def simulate(
    mission: Mission, folder: RunFolder, console: Console, *, seed: int, deaths: Mapping[str, float] | None = None
) -> tuple[RunSummary, dict[str, Any], int]:
    """Fly the same agents in one process on a virtual clock; returns as `demo` does."""
    import numpy as np  # noqa: PLC0415

    from mpc_cover.service.run.progress import Progress  # noqa: PLC0415
    from mpc_cover.service.run.swarm_simulate import fly_swarm  # noqa: PLC0415

    with Progress(console) as progress:
        flight = fly_swarm(mission, seed=seed, deaths=deaths, on_tick=progress.show)
    console.print(flight.outcome, highlight=False, markup=False, soft_wrap=True)
    every = np.array([taken for each in flight.decide_s.values() for taken in each])
    extra: dict[str, Any] = {
        "complete": flight.complete,
        "outcome": flight.outcome,
        "controller": "potential",
        "lost": list(flight.lost),
        "messages": flight.messages,
        "bytes": flight.bytes,
    }
    if flight.estimate_errors:
        extra["estimate_rms_errors"] = flight.estimate_errors
    summary = folder.write(flight.trajectory, every, extra)
    extra["folder"] = str(folder.path)
    return summary, extra, 0 if flight.complete and summary.holds else 1
