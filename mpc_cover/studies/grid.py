"""The grid of a study: all its runs, validated before the first is flown."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import product
from typing import TYPE_CHECKING, TypeVar

from mpc_cover.control.controller_name import ControllerName
from mpc_cover.errors import UserError
from mpc_cover.mission.config import Disturbance
from mpc_cover.mission.load import load_mission
from mpc_cover.service.protocol.fingerprint import mission_hash
from mpc_cover.studies.controllers import BACKEND, check_flight, controller_of
from mpc_cover.studies.runs import Run
from mpc_cover.studies.starts import Starts, random_starts
from solvers.backends.registry import BACKENDS

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from mpc_cover.mission.load import Mission

Item = TypeVar("Item")


@dataclass(frozen=True)
class Grid:
    """The parameters to vary. A run is made for every combination.

    Attributes
    ----------
    missions : files, or names of missions of the package.
    horizons : steps, as "24", or seconds, as "12s", rounded up to whole steps.
    periods : [s]; none for each mission's own.
    seeds : how many, from 0 on.
    backends, controllers : names.
    starts : one of `Starts`.
    """

    missions: Sequence[str]
    horizons: Sequence[str]
    periods: Sequence[float] = ()
    seeds: int = 20
    backends: Sequence[str] = (BACKEND,)
    controllers: Sequence[str] = (ControllerName.MPC,)
    starts: str = Starts.RANDOM


@dataclass(frozen=True, eq=False)
class Work:
    """The runs in the order of execution, a fingerprint of each mission by name, remarks for the user."""

    runs: list[Run]
    fingerprints: dict[str, str]
    remarks: list[str]


def runs_of(grid: Grid) -> Work:
    """Return all runs, all combinations of the first seed first; every mission that they need has been built.

    Raises
    ------
    UserError
        Anything that would stop one of the runs: an empty list, an unknown name, a horizon that is too short to
        brake in, a fleet for which there is no room, two missions of one name.
    """
    _check(grid)
    missions = [load_mission(name) for name in _each(grid.missions)]
    names = [mission.spec.name for mission in missions]
    if twins := sorted({name for name in names if names.count(name) > 1}):
        raise UserError(f"MISSION: two of them are called {', '.join(twins)}: give each a name of its own")
    first = [run for mission in missions for run in _runs(grid, mission)]
    for run in first:
        check_flight(run.build(), run.controller, backend=run.backend or BACKEND)
    if grid.starts == Starts.RANDOM:
        for mission, seed in product(missions, range(1, grid.seeds)):
            random_starts(mission, seed)
    runs = [replace(run, seed=seed) for seed in range(grid.seeds) for run in first]
    return Work(runs, dict(zip(names, map(mission_hash, missions), strict=True)), _remarks(grid, missions))


def _check(grid: Grid) -> None:
    """Refuse options that are invalid for any mission."""
    if grid.seeds < 1:
        raise UserError(f"--seeds {grid.seeds}: must be at least 1: a study with no seeds flies nothing")
    lists = {"MISSION": grid.missions, "--horizons": grid.horizons, "--backends": grid.backends}
    for option, given in {**lists, "--controllers": grid.controllers}.items():
        if not given:
            raise UserError(f"{option}: is empty: give one or more, separated by commas")
    for controller in grid.controllers:
        controller_of(controller)
    for backend in grid.backends:
        if backend not in BACKENDS:
            raise UserError(f"--backends {backend}: is none: must be among {', '.join(BACKENDS)}")
    for period in grid.periods:
        if not (math.isfinite(period) and period > 0.0):
            raise UserError(f"--periods {period:g}: must be a number of seconds greater than 0")
    if grid.starts not in set(Starts):
        raise UserError(f"--starts {grid.starts}: must be one of {', '.join(Starts)}")


def _runs(grid: Grid, mission: Mission) -> Iterator[Run]:
    """Yield a mission's runs of seed 0; those without a horizon once a period."""
    text, name, starts = mission.to_json(), mission.spec.name, Starts(grid.starts)
    periods = _each(grid.periods) or [mission.spec.control.period_s]
    for controller, period in product(_each(grid.controllers), periods):
        if not controller_of(controller).plans_ahead:
            yield Run(name, text, controller, None, None, period, 0, starts)
            continue
        steps = _each([steps_of(horizon, period) for horizon in grid.horizons])
        for backend, horizon in product(_each(grid.backends), steps):
            yield Run(name, text, controller, backend, horizon, period, 0, starts)


def steps_of(horizon: str, period_s: float) -> int:
    """Return how many steps a horizon has: "24", or "12s" in seconds, rounded up to whole steps.

    Raises
    ------
    UserError
        It is neither, or not greater than 0.
    """
    seconds = horizon.removesuffix("s").strip()
    try:
        steps = int(horizon) if seconds == horizon else math.ceil(float(seconds) / period_s - 1e-9)
    except (ValueError, OverflowError):
        steps = 0
    if steps < 1:
        raise UserError(f"--horizons {horizon}: must be a number of steps, as 24, or of seconds, as 12s")
    return steps


def _remarks(grid: Grid, missions: Sequence[Mission]) -> list[str]:
    """Return warnings about options that the user may not have meant."""
    if grid.starts == Starts.RANDOM or grid.seeds == 1:
        return []
    still = [mission.spec.name for mission in missions if mission.spec.disturbance == Disturbance()]
    remark = "start alike and are not disturbed: only what is random in a controller differs between their seeds"
    return [f"{', '.join(still)}: {remark}"] if still else []


def _each(items: Iterable[Item]) -> list[Item]:
    """Return the items in order, each once."""
    return list(dict.fromkeys(items))
