"""Small missions for the benchmark's tests: a few cells, two agents, eight steps."""

from __future__ import annotations

import numpy as np

from mpc_cover.mission.load import build_mission
from mpc_cover.studies.case import start_from

START = [[0.5, 0.5], [1.5, 0.5]]
LIMITS = {"sensing_radius_m": 0.8, "input_max_m_per_s2": 1.5, "speed_max_m_per_s": 1.5}


def small_mission(planning=None, **fleet):
    """Return two agents on 3 m x 3 m; `planning` and `fleet` change these sections."""
    agents = [{"id": f"a{i + 1}", "start_m": start} for i, start in enumerate(START)]
    raw = {
        "schema": 1,
        "name": "small",
        "area": {"shape": {"kind": "box", "min_m": [0, 0], "max_m": [3, 3]}, "cell_size_m": 0.5},
        "fleet": {
            "defaults": LIMITS,
            "agents": agents,
            "separation_min_m": 0.4,
            "communication_range_m": 2.5,
            **fleet,
        },
        "control": {"period_s": 0.5, "horizon_steps": 6},
        "planning": {"duration_s": 4.0, **(planning or {})},
    }
    return build_mission(raw, "small")


def ended_mission():
    """Return one in which everyone must come back to where it started."""
    agents = [{"id": f"a{i + 1}", "start_m": start, "end_m": start} for i, start in enumerate(START)]
    return small_mission({"end": "fixed"}, agents=agents)


def closed_mission():
    """Return one with a free start and a closed end."""
    return small_mission({"start": "free", "end": "closed"})


def far_sighted_mission():
    """Return one in which everything is seen from the start."""
    return small_mission(defaults={**LIMITS, "sensing_radius_m": 5.0})


def two_magnitudes():
    """Return agents that measure different things with different radii."""
    agents = [
        {"id": "a1", "start_m": [0.5, 0.5], "sensing_radius_m": {"wind": 0.8, "heat": 0.5}},
        {"id": "a2", "start_m": [1.5, 0.5], "sensing_radius_m": {"heat": 1.0}},
    ]
    spec = small_mission().spec.model_dump(by_alias=True, exclude_none=True)
    spec["magnitudes"], spec["fleet"]["agents"] = ["wind", "heat"], agents
    del spec["fleet"]["defaults"]["sensing_radius_m"]
    return build_mission(spec, "two magnitudes")


def wiggled(case, seed=0):
    """Return a decision vector that is nobody's optimum: the sweep with noise on its velocities, ends as asked."""
    rng = np.random.default_rng(seed)
    x = start_from(case, "boustrophedon")
    return case.ocp.exact_ends(x + 0.05 * rng.standard_normal(x.size))
