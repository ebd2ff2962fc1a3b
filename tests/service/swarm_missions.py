"""Small missions for fleets without a controller."""

from mpc_cover.mission.load import build_mission

STARTS = ([1.0, 1.0], [2.0, 1.0], [1.5, 2.0], [3.0, 2.0])


def swarm_mission(agents=3, size=5.0, **sections):
    raw = {
        "schema": 1,
        "name": "swarm",
        "area": {"shape": {"kind": "box", "min_m": [0, 0], "max_m": [size, size]}, "cell_size_m": 0.5},
        "fleet": {
            "defaults": {"sensing_radius_m": 1.0, "input_max_m_per_s2": 1.5, "speed_max_m_per_s": 1.0},
            "agents": [{"id": f"a{i + 1}", "start_m": start} for i, start in enumerate(STARTS[:agents])],
            "separation_min_m": 0.4,
            "communication_range_m": 3.5,
        },
        "control": {"period_s": 0.5, "time_limit_s": 200},
    }
    for name, section in sections.items():
        raw.setdefault(name, {}).update(section)
    return build_mission(raw, "swarm")
