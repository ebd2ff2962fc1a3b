"""Small missions with each kind of information."""

from __future__ import annotations

from mpc_cover.mission.load import build_mission

KINDS = {
    "coverage": {"kind": "coverage"},
    "looks": {"kind": "looks", "looks": 2},
    "effective": {"kind": "effective", "level": 1.5, "peak": 1.0, "rim": 0.3},
    "kalman": {"kind": "kalman", "noise_variance": 1.0, "prior_variance": 4.0, "target_variance": 0.4},
    "ageing": {"kind": "ageing", "age_limit_s": 6.0},
}
SEVERAL = ["looks", "effective", "kalman"]


def mission_with(information, *, radius=1.0, edge=4.0, noise=0.0, looks=None, cell_size=0.5, **control):
    """Return two agents in a square field; `information` as in a mission file, or None."""
    raw = {
        "schema": 1,
        "name": "kinds",
        "area": {"shape": {"kind": "box", "min_m": [0, 0], "max_m": [edge, edge]}, "cell_size_m": cell_size},
        "fleet": {
            "defaults": {"sensing_radius_m": radius, "input_max_m_per_s2": 1.5, "speed_max_m_per_s": 1.5},
            "agents": [{"id": "a1", "start_m": [1.0, 1.0]}, {"id": "a2", "start_m": [2.5, 1.0]}],
            "separation_min_m": 0.5,
            "communication_range_m": 3.5,
        },
        "control": {"period_s": 0.5, "horizon_steps": 10, "planning_time_s": 3.0, **control},
        "disturbance": {"position_noise_m": noise},
    }
    if information is not None:
        raw["information"] = information
    if looks is not None:
        raw["area"]["looks"] = looks
    return build_mission(raw, "kinds")
