"""Every rule of a mission has a test: the path of the mistake, and what would be right."""

from __future__ import annotations

import pytest
from mission_files import REMOVE, changed, mistakes, raw_mission

from mpc_cover.mission.load import build_mission
from mpc_cover.mission.planning_rules import MAX_PLAN_STEPS
from mpc_cover.mission.validation import MAX_CELLS

POLYGON = {"kind": "polygon", "outline_m": [[0, 0], [10, 0], [10, 10], [0, 10]]}
SPATIAL = {"kind": "polygon", "outline_m": [[0, 0, 0], [9, 0], [9, 9]]}
SPATIAL_HOLE = {**POLYGON, "holes_m": [[[1, 1, 1], [2, 1], [2, 2]]]}


def test_the_small_mission_is_right():
    mission = build_mission(raw_mission(), "test")
    assert mission.field.size == 100
    assert mission.fleet.ids == ("a1", "a2")


@pytest.mark.parametrize(
    ("path", "value", "where", "right"),
    [
        # field by field
        ("schema", 2, "schema", "must be 1"),
        ("schema", True, "schema", "not true or false"),
        ("schema", REMOVE, "schema", "is missing"),
        ("name", "a b", "name", "letters, digits"),
        ("name", REMOVE, "name", "is missing"),
        ("colour", "red", "colour", "is not a known key"),
        ("fleet.agents.0.colour", "red", "fleet.agents.0.colour", "is not a known key"),
        ("area", None, "area", "must be a mapping"),
        ("area", [1], "area", "must be a mapping"),
        ("area.shape.kind", "star", "area.shape", "'box', 'disc', 'polygon'"),
        ("area.shape.kind", REMOVE, "area.shape", "box, disc or polygon"),
        ("area.shape.min_m", [0], "area.shape.min_m", "2 or more entries"),
        ("area.shape.min_m", [0, 0, 0, 0], "area.shape.min_m", "3 or fewer entries"),
        ("area.shape.min_m", 3, "area.shape.min_m", "must be a list"),
        ("area.cell_size_m", -1, "area.cell_size_m", "greater than 0"),
        ("area.cell_size_m", 0, "area.cell_size_m", "greater than 0"),
        ("area.cell_size_m", True, "area.cell_size_m", "not true or false"),
        ("area.cell_size_m", "wide", "area.cell_size_m", "must be a number"),
        ("area.cell_size_m", float("nan"), "area.cell_size_m", "must be finite"),
        ("area.cell_size_m", float("inf"), "area.cell_size_m", "must be"),
        ("area.cell_size_m", 1e-300, "area.cell_size_m", "must be at least 1e-08"),
        ("area.cell_size_m", 10**400, "area.cell_size_m", "must be"),
        ("area.shape.max_m", [1e308, 1], "area.shape.max_m.0", "less than or equal to 100000000"),
        ("fleet.agents", [], "fleet.agents", "1 or more entries"),
        ("fleet.agents", {"a1": 1}, "fleet.agents", "must be a list"),
        ("fleet.agents.0.id", 7, "fleet.agents.0.id", "must be a text"),
        ("fleet.agents.0.id", "a/b", "fleet.agents.0.id", "letters, digits"),
        ("fleet.agents.0.start_m", REMOVE, "fleet.agents.0.start_m", "is missing"),
        ("fleet.agents.0.start_m", [1, "x"], "fleet.agents.0.start_m.1", "must be a number"),
        ("fleet.defaults.sensing_radius_m", -1, "fleet.defaults.sensing_radius_m", "greater than 0"),
        ("fleet.defaults.sensing_radius_m", {}, "fleet.defaults.sensing_radius_m", "must be"),
        ("fleet.separation_min_m", -0.1, "fleet.separation_min_m", "greater than or equal to 0"),
        ("fleet.communication_range_m", 0, "fleet.communication_range_m", "greater than 0"),
        ("magnitudes", [], "magnitudes", "1 or more entries"),
        ("magnitudes", "coverage", "magnitudes", "must be a list"),
        ("control.horizon_steps", 1, "control.horizon_steps", "greater than or equal to 2"),
        ("control.horizon_steps", 20.5, "control.horizon_steps", "integer"),
        ("control.deadline_fraction", 0.95, "control.deadline_fraction", "less than or equal to 0.9"),
        ("control.period_s", 0, "control.period_s", "greater than 0"),
        # across fields: the shape
        ("area.shape.max_m", [10, 10, 10], "area.shape.max_m", "must have 2 coordinates"),
        ("area.shape.max_m", [10, 0], "area.shape.max_m", "must be greater than min_m"),
        ("area.shape", {**POLYGON, "outline_m": [[0, 0], [9, 9], [9, 0], [0, 9]]}, "area.shape", "Self-intersection"),
        ("area.shape", {**POLYGON, "outline_m": [[0, 0], [9, 9], [0, 0]]}, "area.shape", "must have an area"),
        ("area.shape", {**POLYGON, "holes_m": [[[20, 20], [21, 20], [21, 21]]]}, "area.shape", "outside"),
        # the area
        ("area.cell_size_m", 1e-3, "area.cell_size_m", f"must give at most {MAX_CELLS}"),
        ("area.weights", {"values": [[0, 0], [0, 0]]}, "area.weights.values", "must hold one greater than 0"),
        ("area.motion_min_m", [0, 0, 0], "area.motion_min_m", "must have 2 coordinates"),
        ("area.motion_max_m", [5], "area.motion_max_m", "2 or more entries"),
        ("area.motion_max_m", [5, 5, 5], "area.motion_max_m", "must have 2 coordinates"),
        ("area.motion_min_m", [11, 0], "area.motion_max_m", "must be greater than motion_min_m"),
        ("fleet.agents.1.start_m", [4, 2, 1], "fleet.agents.1.start_m", "must have 2 coordinates"),
        ("fleet.agents.1.start_m", [4, -0.1], "fleet.agents.1.start_m", "must lie between"),
        # the agents
        ("fleet.agents.1.id", "a1", "fleet.agents.1.id", "is already the id of fleet.agents.0"),
        ("fleet.defaults.sensing_radius_m", REMOVE, "fleet.agents.0.sensing_radius_m", "fleet.defaults"),
        ("fleet.defaults.speed_max_m_per_s", REMOVE, "fleet.agents.1.speed_max_m_per_s", "is missing"),
        ("fleet.defaults.input_max_m_per_s2", REMOVE, "fleet.agents.0.input_max_m_per_s2", "is missing"),
        ("fleet.agents.0.sensing_radius_m", {"wind": 1}, "fleet.agents.0.sensing_radius_m", "unknown magnitudes"),
        ("magnitudes", ["coverage", "coverage"], "magnitudes", "listed more than once"),
        # what ties them together
        ("fleet.communication_range_m", 0.5, "fleet.communication_range_m", "greater than separation_min_m"),
        ("fleet.agents.1.start_m", [2.3, 2], "fleet.agents.1.start_m", "is 0.3 m from a1"),
        ("fleet.agents.1.start_m", [8, 2], "fleet.agents.1.start_m", "is not connected to a1"),
        # the control
        ("control.horizon_steps", 3, "control.horizon_steps", "must be at least 4"),
        ("control.state_period_s", 0.6, "control.state_period_s", "must be at most period_s"),
        ("planning.duration_s", 0.9, "planning.duration_s", "at least two periods"),
        ("planning.duration_s", 1e7, "planning.duration_s", f"at most {MAX_PLAN_STEPS} periods"),
    ],
)  # fmt: skip
def test_a_mistake_is_named_with_what_would_be_right(path, value, where, right):
    found = mistakes(changed((path, value)))
    assert where in found
    assert right in found[where]


def test_radius_for_a_magnitude_points_at_the_magnitude():
    found = mistakes(changed(("fleet.defaults.sensing_radius_m", {"coverage": -1})))
    assert found == {"fleet.defaults.sensing_radius_m.coverage": "must be greater than 0"}


def test_a_magnitude_that_nobody_measures():
    found = mistakes(changed(("magnitudes", ["wind", "heat"]), ("fleet.defaults.sensing_radius_m", {"wind": 1.0})))
    assert found == {"magnitudes": "is measured by no agent: give one a sensing radius for it"}


def test_every_mistake_is_reported_at_once():
    found = mistakes(
        changed(
            ("colour", 3),
            ("area.cell_size_m", -1),
            ("fleet.defaults.sensing_radius_m", -1),
            ("fleet.agents.1.id", "a1"),
            ("fleet.agents.1.start_m", [2.1, 2]),
            ("control.state_period_s", 2),
        )
    )
    assert set(found) == {
        "colour",
        "area.cell_size_m",
        "fleet.defaults.sensing_radius_m",
        "fleet.agents.1.id",
        "fleet.agents.1.start_m",
        "control.state_period_s",
    }


def test_a_broken_area_hides_no_mistake_of_the_fleet():
    found = mistakes(changed(("area", REMOVE), ("name", 3), ("fleet.agents.1.start_m", [9, 2])))
    assert set(found) == {"area", "name", "fleet.agents.1.start_m"}
    assert "not connected" in found["fleet.agents.1.start_m"]


def test_mistakes_across_fields_are_reported_beside_those_of_single_fields():
    found = mistakes(changed(("colour", 3), ("control.deadline_fraction", 2), ("fleet.agents.1.start_m", [2.1, 2])))
    assert set(found) == {"colour", "control.deadline_fraction", "fleet.agents.1.start_m"}


def test_a_chain_of_agents_is_connected():
    agents = [{"id": f"a{i}", "start_m": [1.0 + 4.0 * i, 1.0]} for i in range(3)]
    mission = build_mission(changed(("fleet.agents", agents)), "test")
    assert mission.fleet.size == 3


def test_without_a_range_nobody_must_be_connected():
    raw = changed(("fleet.communication_range_m", REMOVE), ("fleet.agents.1.start_m", [9, 9]))
    assert build_mission(raw, "test").fleet.communication_range == float("inf")


def test_agents_brake_within_the_horizon():
    raw = changed(("fleet.agents.1.input_max_m_per_s2", 0.1))
    assert mistakes(raw) == {"control.horizon_steps": "must be at least 32: a2 brakes in 30 steps"}


def test_ends_out_of_range_are_refused_and_said():
    ends = [("planning.end", "fixed"), ("fleet.agents.0.end_m", [1, 1]), ("fleet.links", [["a1", "a2"]])]
    build_mission(changed(*ends, ("fleet.agents.1.end_m", [5, 1])), "near")
    far = mistakes(changed(*ends, ("fleet.agents.1.end_m", [7, 1])))
    assert far["fleet.agents.1.end_m"] == "is not connected to a1's end within communication_range_m 5.0 m"
    assert far["fleet.links.0"] == "ends 6 m long, must be at most communication_range_m 5.0 m"
