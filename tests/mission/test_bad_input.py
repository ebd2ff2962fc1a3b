"""Inputs as they come from maps, editors and other programs: mended where nothing is in doubt, else refused by name."""

import io

import numpy as np
import pytest
import yaml
from mission_files import changed, mistakes

from mpc_cover.errors import InvalidInputError, Problem
from mpc_cover.mission.load import build_mission, load_mission

SQUARE = [[0, 0], [10, 0], [10, 10], [0, 10]]


def polygon(outline, holes=()):
    return ("area.shape", {"kind": "polygon", "outline_m": outline, "holes_m": list(holes)})


@pytest.mark.parametrize(
    ("shape", "area"),
    [
        (polygon([[0, 0], [10, 0], [13, 0], [10, 0], [10, 10], [0, 10]]), 100.0),
        (polygon([[0, 0], [10, 0], [10, 10], [4, 10], [4, 12], [4, 10], [0, 10]]), 100.0),
        (polygon(SQUARE, [[[0, 6], [1, 6], [1, 8], [0, 8]]]), 98.0),
        (polygon([[*point, 400.0] for point in SQUARE]), 100.0),
        (polygon([*SQUARE, SQUARE[0]]), 100.0),
    ],
    ids=["a spike aside", "a spike", "a hole at the outline", "altitudes", "closed"],
)
def test_a_polygon_whose_area_is_not_in_doubt_is_accepted(shape, area):
    mission = build_mission(changed(shape), "test")
    assert mission.field.measure == pytest.approx(area)
    np.testing.assert_allclose(mission.field.shape_max, [10.0, 10.0])


@pytest.mark.parametrize(
    ("shape", "right"),
    [
        (polygon([[0, 0], [10, 10], [10, 0], [0, 10]]), "Self-intersection at (5, 5)"),
        (polygon(SQUARE, [[[1, 6], [3, 6], [3, 8], [1, 8]], [[2, 6], [4, 6], [4, 8], [2, 8]]]), "at (2, 8)"),
        (polygon([[0, 0], [5, 5], [3, 3]]), "must have an area"),
        (polygon([[1, 1], [1, 1], [1, 1]]), "must have an area"),
    ],
    ids=["a bow tie", "holes that overlap", "collinear", "a point"],
)
def test_a_polygon_in_doubt_is_refused_with_the_reason(shape, right):
    assert right in mistakes(changed(shape))["area.shape"]


@pytest.mark.parametrize("radius", [5.0, 0.0002])
def test_degrees_are_told_from_metres(radius):
    corners = {"kind": "box", "min_m": [8.54, 47.37], "max_m": [8.55, 47.38]}
    agents = [{"id": "a1", "start_m": [8.545, 47.375]}]
    raw = changed(
        ("area.shape", corners),
        ("area.cell_size_m", 2e-4),
        ("fleet.agents", agents),
        ("fleet.defaults.sensing_radius_m", radius),
    )
    assert "degrees of longitude and latitude" in mistakes(raw)["area.shape"]


@pytest.mark.parametrize("scale", [1e-3, 1.0, 30.0])
@pytest.mark.parametrize("offset", [0.0, 100.0])
def test_a_small_area_in_metres_is_none_in_degrees(scale, offset):
    raw = changed(
        ("area.shape", {"kind": "box", "min_m": [offset, offset], "max_m": [offset + 5 * scale, offset + 5 * scale]}),
        ("area.cell_size_m", 0.5 * scale),
        ("fleet.agents", [{"id": "a1", "start_m": [offset + scale, offset + scale]}]),
        ("fleet.defaults", {"sensing_radius_m": 10.0 * scale, "speed_max_m_per_s": scale, "input_max_m_per_s2": scale}),
    )
    assert build_mission(raw, "test").field.size == 100


def saved(array):
    file = io.BytesIO()
    np.save(file, array)
    return file.getvalue()


WHOLE = saved(np.ones((3, 3)))
CORRUPT = {
    "empty.npy": b"",
    "cut.npy": WHOLE[:-9],
    "header.npy": WHOLE.replace(b"(3, 3)", b"(3,'a'"),
    "huge.npy": WHOLE.replace(b"(3, 3), }      ", b"(3000000,90000) }")[: len(WHOLE)],
    "negative.npy": saved(-np.ones((2, 2))),
    "empty.png": b"",
    "cut.png": b"\x89PNG\r\n\x1a\n" + b"x" * 50,
    "cut.jpg": b"\xff\xd8\xff\xe0aaaa",
    "text.txt": b"hi",
}


@pytest.mark.parametrize("name", CORRUPT)
def test_corrupt_weights_are_refused_by_name(tmp_path, name):
    (tmp_path / name).write_bytes(CORRUPT[name])
    mission = tmp_path / "mission.yaml"
    mission.write_text(yaml.safe_dump(changed(("area.weights", {"file": name}))), encoding="utf-8")
    with pytest.raises(InvalidInputError, match=f"area.weights.file: '{name}': cannot be read as weights"):
        load_mission(mission)


def test_agents_are_named_by_id_and_what_is_missing_has_no_value():
    raw = changed(("fleet.agents.1.start_m", [40, 2]), ("fleet.agents.0.speed_max_m_per_s", -1))
    with pytest.raises(InvalidInputError) as error:
        build_mission(raw, "test")
    assert "fleet.agents.1.start_m (a2): (40.0, 2.0): must lie between (0.0, 0.0)" in str(error.value)
    assert "fleet.agents.0.speed_max_m_per_s (a1): -1: must be greater than 0" in str(error.value)
    assert str(Problem("area", None, "is missing")) == "area: is missing"


def test_numbers_of_numpy_are_shown_as_numbers():
    assert str(Problem("x", (np.float64(2.5), np.arange(2)), "wrong")) == "x: (2.5, [0, 1]): wrong"
