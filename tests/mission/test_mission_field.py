"""The cells of W and the fleet's arrays."""

from __future__ import annotations

import numpy as np
import pytest
from mission_files import REMOVE, changed

from mpc_cover.mission.load import build_mission


def field_of(shape, size):
    mission = build_mission(
        changed(
            ("area.shape", shape),
            ("area.cell_size_m", size),
            ("area.motion_min_m", [-50, -50]),
            ("area.motion_max_m", [50, 50]),
        ),
        "test",
    )
    return mission.field


def test_cells_of_a_box_are_its_raster():
    field = field_of({"kind": "box", "min_m": [1, 2], "max_m": [3, 3]}, 0.5)
    assert field.size == 8
    np.testing.assert_allclose(field.cell[:3], [[1.25, 2.25], [1.25, 2.75], [1.75, 2.25]])
    assert field.measure == pytest.approx(2.0)


@pytest.mark.parametrize("size", [0.1, 0.3, 0.7, 1.1, 3.0])
def test_no_point_of_a_box_is_farther_from_a_centroid_than_half_a_diagonal(size):
    field = field_of({"kind": "box", "min_m": [0, 0], "max_m": [2, 1]}, size)
    points = np.random.default_rng(1).uniform([0, 0], [2, 1], (500, 2))
    distance = np.linalg.norm(points[:, None] - field.cell, axis=2).min(axis=1)
    assert distance.max() <= size / np.sqrt(2.0) + 1e-9
    assert (field.cell >= 0.0).all()
    assert (field.cell <= [2.0, 1.0]).all()


def test_cells_of_a_disc_lie_in_it():
    field = field_of({"kind": "disc", "center_m": [5, 5], "radius_m": 4}, 0.25)
    assert (np.linalg.norm(field.cell - 5.0, axis=1) <= 4.0).all()
    assert field.measure == pytest.approx(16 * np.pi, rel=0.02)


def test_cells_of_a_polygon_leave_its_hole_out():
    outline = [[0, 0], [10, 0], [10, 10], [0, 10]]
    field = field_of({"kind": "polygon", "outline_m": outline, "holes_m": [[[2, 2], [4, 2], [4, 4], [2, 4]]]}, 0.5)
    assert field.size == 400 - 16
    inside = ((field.cell > 2) & (field.cell < 4)).all(axis=1)
    assert not inside.any()


def test_cells_of_a_triangle():
    field = field_of({"kind": "polygon", "outline_m": [[0, 0], [8, 0], [0, 8]]}, 0.1)
    assert field.measure == pytest.approx(32.0, rel=0.02)
    assert (field.cell.sum(axis=1) <= 8.0 + 1e-9).all()


def test_cells_of_a_ball():
    agents = [{"id": "a1", "start_m": [0, 0, 0]}]
    raw = changed(
        ("area.shape", {"kind": "disc", "center_m": [0, 0, 0], "radius_m": 2}),
        ("area.cell_size_m", 0.2),
        ("fleet.agents", agents),
    )
    mission = build_mission(raw, "test")
    assert mission.field.measure == pytest.approx(32 / 3 * np.pi, rel=0.02)
    assert mission.fleet.dimension == 3


def test_one_cell_is_enough():
    field = field_of({"kind": "box", "min_m": [0, 0], "max_m": [1, 1]}, 50.0)
    assert field.size == 1


def test_agents_own_values_come_before_the_defaults():
    mission = build_mission(
        changed(
            ("fleet.agents.1.speed_max_m_per_s", 3.0),
            ("fleet.agents.1.sensing_radius_m", 2.5),
            ("area.motion_max_m", [12, 11]),
        ),
        "test",
    )
    np.testing.assert_array_equal(mission.fleet.speed_max, [1.5, 3.0])
    np.testing.assert_array_equal(mission.fleet.radius, [[1.0], [2.5]])
    np.testing.assert_array_equal(mission.fleet.motion_min, [0, 0])
    np.testing.assert_array_equal(mission.fleet.motion_max, [12, 11])


def test_what_an_agent_cannot_measure_has_no_radius():
    raw = changed(
        ("magnitudes", ["wind", "heat"]),
        ("fleet.agents.0.sensing_radius_m", {"heat": 2.0}),
        ("fleet.separation_min_m", REMOVE),
    )
    mission = build_mission(raw, "test")
    np.testing.assert_array_equal(mission.fleet.radius, [[-np.inf, 2.0], [1.0, 1.0]])
    assert mission.fleet.separation_min == 0.0
