"""The smallest mission that two agents share, as a mission file has it; WIDE lets both laws fly it."""

TINY = {
    "schema": 1,
    "name": "tiny",
    "area": {"shape": {"kind": "box", "min_m": [0.0, 0.0], "max_m": [3.0, 3.0]}, "cell_size_m": 0.5},
    "fleet": {
        "defaults": {"sensing_radius_m": 0.7, "input_max_m_per_s2": 1.0, "speed_max_m_per_s": 1.0},
        "agents": [{"id": "a1", "start_m": [0.75, 0.5]}, {"id": "a2", "start_m": [2.25, 0.5]}],
        "separation_min_m": 0.4,
        "communication_range_m": 3.0,
    },
}

WIDE = {**TINY, "fleet": {**TINY["fleet"], "communication_range_m": 4.0}}
