"""The cells of W and the fleet's arrays."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from mission_files import REMOVE, changed

from mpc_cover.errors import InvalidInputError
from mpc_cover.information.visibility import Visibility
from mpc_cover.mission.cell_rules import coarse_warning
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


@pytest.mark.parametrize("size", [0.1, 0.3, 0.7, 1.1, 1.3])
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


@pytest.mark.parametrize("size", [0.3, 0.7, 0.9, 1.1])
@pytest.mark.parametrize("extent", [(10.0, 10.0), (2.0, 0.31)])
def test_border_cells_count_for_what_lies_inside(size, extent):
    field = field_of({"kind": "box", "min_m": [0, 0], "max_m": list(extent)}, size)
    assert field.measure == pytest.approx(extent[0] * extent[1], rel=1e-9)
    assert (field.cell < extent).all()


THIN = {
    "a frame 0.1 m wide": [[0, 0], [10, 0], [10, 10], [9.9, 10], [9.9, 0.1], [0, 0.1]],
    "a thin triangle": [[0, 0], [20, 0], [0, 1]],
    "a diagonal path": [[0, 0], [0.2, 0], [10, 9.8], [10, 10], [9.8, 10], [0, 0.2]],
}


@pytest.mark.parametrize("outline", THIN.values(), ids=THIN)
def test_no_thin_part_of_a_polygon_is_dropped(outline):
    polygon = shapely.Polygon(outline)
    field = field_of({"kind": "polygon", "outline_m": outline}, 0.5)
    assert field.measure == pytest.approx(polygon.area, rel=2e-3)
    points = shapely.points(field.cell)
    assert shapely.distance(points, polygon).max() < 1e-9
    line = shapely.get_coordinates(shapely.segmentize(polygon.exterior, 0.05))
    distance = np.linalg.norm(line[:, None] - field.cell, axis=2).min(axis=1)
    assert distance.max() <= 0.5 * np.sqrt(2.0)


@pytest.mark.parametrize("outline", THIN.values(), ids=THIN)
def test_cells_off_the_grid_are_seen_by_their_distance(outline):
    field = field_of({"kind": "polygon", "outline_m": outline}, 0.5)
    seen = Visibility(field, np.array([[0.8], [1.1]]))
    position = np.random.default_rng(2).uniform(0, 10, (2, 2))
    looks = seen.looks(0.0, position)
    distance = np.linalg.norm(field.cell - position[:, None], axis=2)
    near = distance <= np.array([[0.8], [1.1]])
    assert set(zip(looks.agent.tolist(), looks.place.tolist(), strict=True)) == set(
        zip(*map(list, np.nonzero(near)), strict=True)
    )


@pytest.mark.parametrize("radius", [0.3, 1.7])
def test_cells_of_which_nobody_sees_the_whole_are_refused(radius):
    with pytest.raises(InvalidInputError, match=r"area.cell_size_m: 2.5: is too coarse for sensing radii"):
        build_mission(changed(("area.cell_size_m", 2.5), ("fleet.defaults.sensing_radius_m", radius)), "test")


def test_coarse_cells_are_warned_of_and_what_is_said_to_be_fine_is():
    coarse = build_mission(changed(("area.cell_size_m", 1.0)), "test").spec
    assert "at most 0.849 would be fine" in (coarse_warning(coarse) or "")
    assert coarse_warning(build_mission(changed(("area.cell_size_m", 0.84)), "test").spec) is None
