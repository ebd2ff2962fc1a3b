"""A tiny mission, runs of it, and records that nobody had to fly for."""

import os
import signal
from dataclasses import replace

import msgspec
from tiny_mission import TINY as TINY_MISSION

from mpc_cover.mission.load import Mission, build_mission
from mpc_cover.studies.record import LEVELS, Record, versions
from mpc_cover.studies.runs import Run

TINY = {**TINY_MISSION, "control": {"period_s": 0.5, "horizon_steps": 8, "planning_time_s": 1.0}}


def tiny(name="tiny", **changes) -> Mission:
    """Return the tiny mission with changes to its sections."""
    return build_mission({**TINY, "name": name, **{key: {**TINY.get(key, {}), **changes[key]} for key in changes}}, "t")


def tiny_run(controller="mpc", seed=0, mission=None, starts="random", **changes) -> Run:
    mission = mission or tiny()
    ahead = controller == "mpc"
    run = Run(
        "tiny", mission.to_json(), controller, "native" if ahead else None, 8 if ahead else None, 0.5, seed, starts
    )
    return replace(run, **{"name": mission.spec.name, **changes})


def record_of(run: Run, **changes) -> Record:
    """Return what a run might have come out with: 99 % after 10 s and a little, by its seed."""
    time = 10.0 + 0.1 * run.seed
    record = Record(
        key=run.key,
        mission=run.name,
        controller=run.controller,
        backend=run.backend,
        horizon_steps=run.horizon_steps,
        horizon_s=run.horizon_s,
        period_s=run.period_s,
        seed=run.seed,
        starts=run.starts,
        agents=2,
        cells=36,
        complete=True,
        covered_percent=100.0,
        time_to_99_s=time,
        swath_bound_s=8.0,
        ratio_99=time / 8.0,
        separation_margin_m=0.1,
        violations=0,
        steps=3,
        versions=versions(),
        curve_s=tuple(time * level / 99.0 for level in LEVELS),
        step_ms=(10.0, 20.0, 30.0 + run.seed),
    )
    return msgspec.structs.replace(record, **changes)


def never(run: Run, **changes) -> Record:
    """Return the record of a run that stalled."""
    stalled = {"complete": False, "covered_percent": 50.0, "time_to_99_s": None, "ratio_99": None}
    curve = tuple(10.0 * level / 50.0 if level <= 50.0 else None for level in LEVELS)
    return record_of(run, **{**stalled, "curve_s": curve, **changes})


def fly_nothing(run: Run) -> Record:
    """Stand in for a flight, wherever it is called."""
    return record_of(run)


def fly_to_death(run: Run) -> Record:
    """Take the process along."""
    os.kill(os.getpid(), signal.SIGKILL)
    return record_of(run)
