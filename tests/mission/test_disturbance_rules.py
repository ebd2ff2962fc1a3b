"""Disturbances that no controller could cope with are refused, with the reason."""

import pytest
from mission_files import changed, mistakes

from mpc_cover.mission.load import build_mission


@pytest.mark.parametrize(
    ("changes", "where", "right"),
    [
        ([("slow_agents", {"a9": 0.5})], "slow_agents", "unknown agents ['a9']: must be among ['a1', 'a2']"),
        ([("slow_agents", {"a1": 0.0})], "slow_agents.a1", "greater than 0"),
        ([("slow_agents", {"a1": 1.5})], "slow_agents.a1", "less than or equal to 1"),
        ([("delay_s", 0.6)], "delay_s", "must be at most period_s 0.5"),
        ([("delay_s", -0.1)], "delay_s", "greater than or equal to 0"),
        ([("wind_m_per_s2", [0.1])], "wind_m_per_s2", "must have 2 coordinates like start_m, or none"),
        ([("wind_m_per_s2", [0.1, 0.0, 0.0])], "wind_m_per_s2", "must have 2 coordinates like start_m, or none"),
        ([("wind_m_per_s2", [0.5, 0.5])], "wind_m_per_s2", "gusts and wind come to 0.707, must be at most 0.6"),
        ([("input_noise_m_per_s2", 0.7)], "input_noise_m_per_s2", "come to 0.7, must be at most 0.6"),
        (
            [("input_noise_m_per_s2", 0.4), ("wind_m_per_s2", [0.0, 0.3])],
            "input_noise_m_per_s2",
            "0.4 of the smallest input",
        ),
        ([("position_noise_m", 0.3)], "position_noise_m", "0.25 of the smallest sensing radius"),
        ([("position_noise_m", -1)], "position_noise_m", "greater than or equal to 0"),
        ([("fog", 1)], "fog", "is not a known key"),
    ],
)
def test_mistakes(changes, where, right):
    found = mistakes(changed(*((f"disturbance.{name}", value) for name, value in changes)))
    assert list(found) == [f"disturbance.{where}"]
    assert right in found[f"disturbance.{where}"]


def test_a_sensing_radius_by_magnitude_counts():
    raw = changed(
        ("magnitudes", ["heat", "light"]),
        ("fleet.defaults.sensing_radius_m", {"heat": 2.0, "light": 0.8}),
        ("disturbance.position_noise_m", 0.25),
    )
    assert mistakes(raw) == {"disturbance.position_noise_m": "must be at most 0.2: 0.25 of the smallest sensing radius"}


def test_what_is_missing_elsewhere_is_not_told_twice():
    raw = changed(("fleet.defaults", {}), ("disturbance.input_noise_m_per_s2", 9.0))
    assert not any(path.startswith("disturbance") for path in mistakes(raw))


def test_disturbances_within_bounds_are_kept():
    mission = build_mission(
        changed(
            ("disturbance.position_noise_m", 0.02),
            ("disturbance.wind_m_per_s2", [0.1, 0]),
            ("disturbance.delay_s", 0.5),
            ("disturbance.slow_agents", {"a2": 0.5}),
        ),
        "test",
    )
    assert mission.spec.disturbance.slow_agents == {"a2": 0.5}
