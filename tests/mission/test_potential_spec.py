"""The `potential` section and `fleet.dynamics`: defaults from the fleet, and every contradiction named."""

import numpy as np
import pytest
from mission_files import REMOVE, changed, mistakes

from mpc_cover.distributed.potential_functions import Coordination
from mpc_cover.distributed.setup import coordination_for, law_parameters
from mpc_cover.mission.load import build_mission, load_mission, mission_from_json


def test_what_is_left_out_follows_from_the_fleet():
    mission = build_mission(changed(("fleet.communication_range_m", 5.5)), "test")
    assert coordination_for(mission, mission.fleet) == Coordination(0.5, 1.0, 5.5, 4.0)
    law = law_parameters(mission)
    assert (law.shape.alpha, law.shape.core_m) == (4.0, 0.5)
    assert law.gain == np.inf
    assert mission.spec.potential.delay_samples == "hops"


def test_the_thesis_missions_are_its_numbers():
    mission = load_mission("fig-6-2")
    assert coordination_for(mission, mission.fleet) == Coordination(0.5, 1.0, 5.5, 4.0)
    assert (mission.fleet.size, mission.spec.area.looks, mission.spec.potential.delay_samples) == (8, 15, 8)
    assert mission.spec.fleet.dynamics == "single"
    assert set(mission.fleet.speed_max) == set(mission.fleet.radius.ravel()) == {1.0}


def test_it_survives_being_written_and_read():
    mission = build_mission(changed(("potential.delay_samples", 3), ("potential.alpha", 3.0)), "test")
    assert mission_from_json(mission.to_json(), "again").spec == mission.spec


def test_single_integrators_need_no_input_bound():
    raw = changed(("fleet.defaults.input_max_m_per_s2", REMOVE))
    assert "fleet.agents.0.input_max_m_per_s2" in mistakes(raw)
    raw["fleet"]["dynamics"] = "single"
    assert build_mission(raw, "test").fleet.input_max.tolist() == [6.0, 6.0]


@pytest.mark.parametrize(
    ("path", "value", "right"),
    [
        ("potential.alpha", 1.0, "greater than 1"),
        ("potential.alpha", True, "must be a number"),
        ("potential.gain_m2_per_s", 0, "greater than 0"),
        ("potential.random_part", 1.5, "less than or equal to 1"),
        ("potential.delay_samples", -1, "greater than or equal to 0"),
        ("potential.mu", 1, "is not a known key"),
        ("potential.core_m", 1.2, "at most the smallest sensing radius, 1"),
        ("potential.repel_within_m", 0.5, "greater than separation_min_m 0.5"),
        ("potential.repel_within_m", 5.5, "at most communication_range_m 5"),
        ("potential.attract_beyond_m", 5.0, "less than communication_range_m 5"),
        ("potential.lost_after_samples", 2, "at least 3"),
        ("fleet.dynamics", "triple", "'double' or 'single'"),
    ],
)
def test_mistakes_are_named(path, value, right):
    found = mistakes(changed((path, value)))
    assert any(where.startswith(path) and right in text for where, text in found.items()), found


@pytest.mark.parametrize(
    ("changes", "path"),
    [
        ([("fleet.separation_min_m", 0.0), ("potential.repel_within_m", 1.0)], "potential.repel_within_m"),
        ([("fleet.communication_range_m", REMOVE), ("potential.attract_beyond_m", 1.0)], "potential.attract_beyond_m"),
        ([("fleet.dynamics", "single"), ("disturbance.wind_m_per_s2", [0.1, 0.0])], "disturbance"),
    ],
)
def test_contradictions_are_named(changes, path):
    assert path in mistakes(changed(*changes))
