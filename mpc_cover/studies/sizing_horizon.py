"""Figure 1.1 with the receding horizon instead of the potential law."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.control.controller_name import ControllerName
from mpc_cover.mission.load import build_mission
from mpc_cover.studies.controllers import run_flight
from mpc_cover.studies.fleet_sizing import SizingProblem, measurement_rate
from mpc_cover.studies.sizing_simulation import CoverageCurve, curve_of, scenario_of

if TYPE_CHECKING:
    from mpc_cover.mission.load import Mission

_PERIOD_S = 0.5
_CELLS_A_RADIUS = 2
_TIME_LIMIT_ROUNDS = 4.0
"""Time limit of a flight, in the model's rounds."""


def sizing_mission(problem: SizingProblem, agents: int, seed: int) -> Mission:
    """Return a square of the problem's area with N double integrators at random starts, without constraints.

    Their u_max is v_max a second: the model's agents have no inertia, these take a second to turn.
    """
    fleet, _ = scenario_of(problem, agents).build(np.random.default_rng([seed, 0]))
    edge = math.sqrt(problem.area_m2)
    raw = {
        "schema": 1,
        "name": f"size-{agents}",
        "area": {
            "shape": {"kind": "box", "min_m": [0.0, 0.0], "max_m": [edge, edge]},
            "cell_size_m": edge / max(1, round(edge / problem.radius_m * _CELLS_A_RADIUS)),
        },
        "fleet": {
            "defaults": {
                "sensing_radius_m": problem.radius_m,
                "speed_max_m_per_s": problem.speed_m_per_s,
                "input_max_m_per_s2": problem.speed_m_per_s,
            },
            "agents": [{"id": name, "start_m": at.tolist()} for name, at in zip(fleet.ids, fleet.start, strict=True)],
        },
        "control": {
            "period_s": _PERIOD_S,
            "time_limit_s": max(30.0, _TIME_LIMIT_ROUNDS / measurement_rate(problem, agents)),
        },
    }
    return build_mission(raw, "fleet sizing")


def horizon_curve(problem: SizingProblem, agents: int, seeds: range, duration_s: float) -> CoverageCurve:
    """Fly N agents by the receding horizon once for each seed and compare with the model over `duration_s` [s]."""
    time = np.arange(0.0, duration_s + _PERIOD_S, _PERIOD_S)
    missions = {seed: sizing_mission(problem, agents, seed) for seed in seeds}
    flights = [run_flight(mission, ControllerName.MPC, seed=seed) for seed, mission in missions.items()]
    return curve_of(problem, agents, time, [flight.trajectory.covered_at for flight in flights])
