"""A small mission as raw data, and ways to break it."""

from __future__ import annotations

import copy
from typing import Any

import pytest

from mpc_cover.errors import InvalidInputError
from mpc_cover.mission.load import build_mission

REMOVE = object()


def raw_mission() -> dict[str, Any]:
    """Return two agents in a box of 10 m, the least that a mission needs and a little more."""
    return {
        "schema": 1,
        "name": "small",
        "area": {"shape": {"kind": "box", "min_m": [0, 0], "max_m": [10, 10]}, "cell_size_m": 1.0},
        "fleet": {
            "defaults": {"sensing_radius_m": 1.0, "input_max_m_per_s2": 1.5, "speed_max_m_per_s": 1.5},
            "agents": [{"id": "a1", "start_m": [2, 2]}, {"id": "a2", "start_m": [4, 2]}],
            "separation_min_m": 0.5,
            "communication_range_m": 5.0,
        },
        "control": {"period_s": 0.5, "horizon_steps": 20},
    }


def changed(*changes: tuple[str, object]) -> dict[str, Any]:
    """Return the mission with values set (or REMOVEd) at dotted paths."""
    raw = raw_mission()
    for path, value in changes:
        *above, last = path.split(".")
        here: Any = raw
        for key in above:
            here = here[int(key)] if isinstance(here, list) else here.setdefault(key, {})
        key = int(last) if isinstance(here, list) else last
        if value is REMOVE:
            del here[key]
        else:
            here[key] = copy.deepcopy(value)
    return raw


def mistakes(raw: object) -> dict[str, str]:
    """Return what is wrong with raw data: a sentence for each path."""
    with pytest.raises(InvalidInputError) as caught:
        build_mission(raw, "mission test")
    assert str(caught.value).startswith("mission test: ")
    return {problem.path: problem.right for problem in caught.value.problems}
