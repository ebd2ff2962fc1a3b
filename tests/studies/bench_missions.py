"""Small missions for the benchmark's tests: a few cells, two agents, eight steps."""

from __future__ import annotations

from mpc_cover.mission.load import build_mission

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
