"""What the command line does, as functions: the public names that `mpc_cover` itself offers.

Arrays are NumPy's; m agents in d dimensions, K cells, lengths in metres, times in seconds. A mission is given by the
name of one that comes along (`"box-3"`), by its file, by the keys of such a file, or as a `Mission`; a recording by its
file or run folder, or as a `Recording`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

from mpc_cover.control.controller_name import ControllerName
from mpc_cover.errors import InvalidInputError, Problem, UserError
from mpc_cover.mission.load import Mission, build_mission
from mpc_cover.mission.load import load_mission as read_mission
from mpc_cover.mission.weights import with_weights
from mpc_cover.trajectory_file import Recording
from mpc_cover.trajectory_file import load_trajectory as read_trajectory

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray
    from mpc_cover.planning.cvxpy_extra.extra import Extra
    from mpc_cover.planning.cvxpy_extra.motion_variables import MotionVariables
    from mpc_cover.verification.report import Report

    ExtraSource: TypeAlias = Extra | Callable[[MotionVariables, Mission], Any] | str

MissionSource: TypeAlias = Mission | Mapping[str, Any] | str | Path
RecordingSource: TypeAlias = Recording | str | Path


@dataclass(frozen=True, eq=False)
class SimulationResult:
    """What a simulated fleet flew, and how that ended.

    Attributes
    ----------
    recording : what was flown, from the take-off on; what was planned is nowhere in it.
    complete : whether everything is covered, as far as those who decide know: the controller, or every agent left.
    outcome : how it ended, in words.
    lost : ids of the agents that were lost.
    step_times : (S,) [s] that the steps of the controller took, or the decisions of all agents.
    events : what was said on the way, in words.
    """

    recording: Recording
    complete: bool
    outcome: str
    lost: tuple[str, ...]
    step_times: FloatArray
    events: tuple[str, ...]


def load_mission(source: MissionSource) -> Mission:
    """Return a validated mission with the arrays built from it; files that keys name are looked for here.

    Raises
    ------
    UserError
        A file that is missing or is not YAML; every mistake of a mission at once, each with its path.
    """
    if isinstance(source, Mission):
        return source
    if isinstance(source, Mapping):
        what = f"mission {source.get('name', 'without a name')}"
        return build_mission(with_weights(dict(source), Path(), what), what)
    _refuse("load_mission", _no_path("mission", source, "a name, a file, a mapping or a Mission"))
    return read_mission(source)


def load_trajectory(source: RecordingSource) -> Recording:
    """Return the recording in a file (.npz) or a run folder.

    Raises
    ------
    UserError
        The file is missing, torn, or not a trajectory file.
    """
    from mpc_cover.service.run.run_folder import find_trajectory  # noqa: PLC0415 - each function imports what it needs

    if isinstance(source, Recording):
        return source
    _refuse("load_trajectory", _no_path("trajectory", source, "a file, a run folder or a Recording"))
    return read_trajectory(find_trajectory(Path(source)))


def plan(
    mission: MissionSource,
    *,
    backend: str | None = None,
    seed: int = 0,
    starts: int = 10,
    time_limit_s: float | None = None,
    min_time: bool = False,
    exact_cones: bool = False,
    formulation: str = "qp",
    extra: ExtraSource | None = None,
) -> Recording:
    """Solve the optimal coverage NLP offline and return the best plan found, as `mpc-cover plan` does.

    Without a time limit the effort is bounded and the result the same every time. What the plan is worth is in its
    `meta`: `cost_m` is J [m] of (4.34), 0 when every cell is covered.

    Parameters
    ----------
    mission : of double integrators; its `planning` says for how long, and between which ends.
    backend : native, which None stands for, or the QP back-end of an SQP: piqp, clarabel or osqp; of the formulation
        cvxpy any solver that CVXPY has, None for clarabel.
    seed : of the random starts.
    starts : initial guesses that are told apart.
    time_limit_s : the search goes on until then [s] while anything is left over.
    min_time : whether to search for the shortest plan that covers everything.
    exact_cones : speeds, inputs and edges as second-order cones, not polygons inside them.
    formulation : qp, or cvxpy: each subproblem in CVXPY, which is slower.
    extra : terms and constraints in CVXPY: a function of (motion, mission), a `MotionVariables` and a `Mission`, that
        returns both; or its name, module:function.

    Raises
    ------
    UserError
        An option that is none, a mission that nobody can plan, something wrong with what `extra` returns, or no motion
        was found that passes the verifier and keeps the constraints of `extra`.
    """
    from mpc_cover.control.factory import require_double  # noqa: PLC0415 - as above
    from mpc_cover.planning.cvxpy_extra.solver_names import DEFAULT_SOLVER  # noqa: PLC0415
    from mpc_cover.planning.offline import Formulation, PlanOptions, plan_mission  # noqa: PLC0415

    problems = [*_no_seed(seed), *_no_time(time_limit_s)]
    if starts < 1:
        problems.append(Problem("starts", starts, "must be at least 1"))
    _refuse("plan", problems)
    loaded = load_mission(mission)
    require_double(loaded)
    backend = backend or (DEFAULT_SOLVER if formulation == Formulation.CVXPY else "native")
    own = _extra(extra)
    limits = (starts, time_limit_s, min_time, exact_cones)
    found = plan_mission(loaded, PlanOptions(backend, seed, *limits, formulation=formulation, extra=own))
    if (failure := check(found, extra=own).first_failure) is not None:
        raise UserError(f"mission {loaded.spec.name}: the plan that was found does not pass the verifier: {failure}")
    return found


def simulate(
    mission: MissionSource,
    *,
    controller: str = "mpc",
    backend: str | None = None,
    seed: int = 0,
    deaths: Mapping[str, float] | None = None,
) -> SimulationResult:
    """Fly a mission in closed loop on a virtual clock, as `mpc-cover simulate` does.

    The same mission, controller, back-end and seed give the same recording to the last bit.

    Parameters
    ----------
    controller : mpc, the receding horizon; or potential, the distributed law, each agent by itself.
    backend : solver of mpc: native, which None stands for, piqp, clarabel or osqp.
    seed : of whatever is random: guesses, noise, gusts, the turns of the potential law.
    deaths : the mission times [s] at which agents die, by id, as if their processes were killed.

    Raises
    ------
    UserError
        An option that is none, deaths that cannot be, or a mission that the controller cannot fly.
    """
    import numpy as np  # noqa: PLC0415 - as above

    from mpc_cover.service.controller.step_log import StepKind  # noqa: PLC0415
    from mpc_cover.service.run.fault_injection import check_deaths  # noqa: PLC0415
    from mpc_cover.service.run.simulate import simulate as fly  # noqa: PLC0415

    loaded, killed = load_mission(mission), dict(deaths or {})
    _refuse("simulate", [*_no_seed(seed), *_no_controller(controller, backend)])
    check_deaths(killed, loaded)
    if controller == ControllerName.POTENTIAL:
        return _simulate_potential(loaded, seed, killed)
    flown = fly(loaded, backend=backend or "native", seed=seed, deaths=killed)
    times = np.array([step.tick_time_s for step in flown.steps if step.kind is StepKind.STEP], dtype=float)
    return SimulationResult(flown.trajectory, flown.complete, flown.outcome, flown.lost, times, tuple(flown.events))


def check(
    recording: RecordingSource, *, mission: MissionSource | None = None, extra: ExtraSource | None = None
) -> Report:
    """Verify a recording by code that shares nothing with planning or control, as `mpc-cover check` does.

    Looked at are dynamics, limits, separation and connectivity along the continuous path, and the coverage that is
    claimed; each check of the report comes with its margin.

    Parameters
    ----------
    mission : what the recording is judged by, agents told apart by their ids; left out, the mission that the recording
        holds, which whoever edits the one may edit as well.
    extra : as of `plan`: its constraints are further checks, at the samples.

    Raises
    ------
    UserError
        The file cannot be read, the mission is of other agents, or something is wrong with what `extra` returns. What
        does not hold is in the report, and is no error.
    """
    from mpc_cover.verification.check import check_trajectory  # noqa: PLC0415 - as above

    loaded = load_trajectory(recording)
    given = None if mission is None else load_mission(mission)
    report = check_trajectory(loaded, given)
    if (own := _extra(extra)) is None:
        return report
    from mpc_cover.planning.cvxpy_extra.checks import with_extra  # noqa: PLC0415 - as above
    from mpc_cover.verification.judged import judged_by  # noqa: PLC0415

    return with_extra(report, loaded if given is None else judged_by(loaded, given), own)


def plot(recording: RecordingSource, folder: str | Path, *, step_times: FloatArray | None = None) -> list[Path]:
    """Verify a recording and draw it, as `mpc-cover plot` does.

    Parameters
    ----------
    folder : where the PNGs go; made where it is missing.
    step_times : (S,) [s], for a figure of them; those of a run folder are found there.

    Returns
    -------
    The files written, the overview first.

    Raises
    ------
    UserError
        The recording cannot be read, or the folder not be written.
    """
    from mpc_cover.service.run.run_folder import find_trajectory, read_step_times  # noqa: PLC0415 - as above
    from mpc_cover.verification.check import check_trajectory  # noqa: PLC0415
    from mpc_cover.view.figures import draw_run  # noqa: PLC0415

    loaded = load_trajectory(recording)
    if step_times is None and not isinstance(recording, Recording):
        step_times = read_step_times(find_trajectory(Path(recording)).parent)
    return draw_run(loaded, folder, step_times, check_trajectory(loaded))


def _simulate_potential(mission: Mission, seed: int, deaths: Mapping[str, float]) -> SimulationResult:
    import numpy as np  # noqa: PLC0415 - as above

    from mpc_cover.distributed.setup import check_flyable  # noqa: PLC0415
    from mpc_cover.service.run.swarm_simulate import fly_swarm  # noqa: PLC0415

    check_flyable(mission)
    flown = fly_swarm(mission, seed=seed, deaths=deaths)
    times = np.array([taken for each in flown.decision_times_s.values() for taken in each], dtype=float)
    return SimulationResult(flown.trajectory, flown.complete, flown.outcome, flown.lost, times, tuple(flown.events))


def _extra(source: ExtraSource | None) -> Extra | None:
    if source is None:
        return None
    from mpc_cover.planning.cvxpy_extra.loading import extra_of  # noqa: PLC0415 - as above

    return extra_of(source)


def _no_time(limit_s: float | None) -> list[Problem]:
    if limit_s is None or (math.isfinite(limit_s) and limit_s > 0.0):
        return []
    return [Problem("time_limit_s", limit_s, "must be a number of seconds greater than 0, or None")]


def _no_seed(seed: int) -> list[Problem]:
    return [] if seed >= 0 else [Problem("seed", seed, "must be at least 0")]


def _no_controller(controller: str, backend: str | None) -> list[Problem]:
    if controller not in {ControllerName.MPC, ControllerName.POTENTIAL}:
        return [Problem("controller", controller, "must be mpc or potential")]
    if controller == ControllerName.POTENTIAL and backend is not None:
        return [Problem("backend", backend, "the potential law solves no QP: leave it out")]
    return []


def _no_path(name: str, source: object, wanted: str) -> list[Problem]:
    is_path = isinstance(source, str | PathLike) and str(source) != ""
    return [] if is_path else [Problem(name, source, f"must be {wanted}")]


def _refuse(what: str, problems: list[Problem]) -> None:
    if problems:
        raise InvalidInputError(what, problems)
