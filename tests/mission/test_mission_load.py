"""Reading mission files: what is no mission ends in one clear message."""

from __future__ import annotations

import textwrap

import numpy as np
import pytest
import yaml
from mission_files import raw_mission

from mpc_cover.errors import InvalidInputError, Problem, UnreadableFileError
from mpc_cover.mission.load import build_mission, load_mission, mission_from_json, shipped_missions


@pytest.fixture
def write(tmp_path):
    def writer(text):
        file = tmp_path / "mission.yaml"
        file.write_bytes(text if isinstance(text, bytes) else textwrap.dedent(text).encode())
        return file

    return writer


def test_a_file_is_read(write):
    mission = load_mission(write(yaml.safe_dump(raw_mission())))
    assert mission.spec.name == "small"


@pytest.mark.parametrize("name", ["box-3", "box-3.yaml"])
def test_a_shipped_mission_is_found_by_its_bare_name(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert load_mission(name).spec.name == "box-3"


def test_a_folder_does_not_hide_a_shipped_mission(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "box-3").mkdir()
    assert load_mission("box-3").spec.name == "box-3"


def test_a_file_of_ones_own_comes_before_a_shipped_mission(write, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write(yaml.safe_dump(raw_mission())).rename(tmp_path / "box-3")
    assert load_mission("box-3").spec.name == "small"


def test_every_shipped_mission_is_right():
    assert shipped_missions()
    for file in shipped_missions():
        assert load_mission(file).field.size > 0


def test_box3_is_what_the_design_says():
    mission = load_mission("box-3")
    fleet = mission.fleet
    assert mission.field.size == 400
    assert mission.field.measure == 100.0
    np.testing.assert_array_equal(fleet.start, [[2, 2], [4, 2], [3, 4]])
    np.testing.assert_array_equal(fleet.radius, np.ones((3, 1)))
    np.testing.assert_array_equal([fleet.input_max, fleet.speed_max], np.full((2, 3), 1.5))
    assert (fleet.separation_min, fleet.communication_range) == (0.5, 5.5)
    np.testing.assert_array_equal([fleet.motion_min, fleet.motion_max], [[0, 0], [10, 10]])


@pytest.mark.parametrize("name", ["no-such", "no/such.yaml", "x" * 5000, "nul\0byte"])
def test_a_missing_file_names_the_missions_that_come_along(name):
    with pytest.raises(UnreadableFileError, match=r"no such file.*box-3"):
        load_mission(name)


@pytest.mark.parametrize("name", ["", "/", ".."])
def test_a_directory_is_no_mission(name):
    with pytest.raises(UnreadableFileError, match="directory"):
        load_mission(name)


@pytest.mark.parametrize("content", [b"\xff\xfe\xfa", b"name: \xe9\n"])
def test_what_is_no_text_is_refused(write, content):
    with pytest.raises(UnreadableFileError, match="is not UTF-8 text"):
        load_mission(write(content))


@pytest.mark.parametrize(
    "text",
    [
        "a: [1",
        "a: 1\na: 2",
        "{a: 1, a: 2}",
        "1: x\n1.0: y",
        "[1, 2]: 3",
        "? {a: 1}\n: 2",
        "---\na: 1\n---\nb: 2",
        "a: !!python/object/apply:os.system [ls]",
        "a: 2024-13-45",
        "\0",
        "[" * 3000,
        "!!timestamp x",
        "!!bool x",
        "!<tag:yaml.org,2002:int> ''",
        "!!map a",
        "=: 1",
        "a: *nowhere",
        "a:\n\t- x",
    ],
)
def test_broken_yaml_ends_in_one_line(write, text):
    with pytest.raises(UnreadableFileError, match="is not valid YAML") as caught:
        load_mission(write(text))
    assert "\n" not in str(caught.value)


def test_duplicate_keys_are_refused_with_their_line(write):
    text = yaml.safe_dump(raw_mission()) + "name: again\n"
    with pytest.raises(UnreadableFileError, match=r"duplicate key 'name'.*line"):
        load_mission(write(text))


def test_duplicate_keys_deep_inside_are_refused(write):
    text = yaml.safe_dump(raw_mission()).replace("  cell_size_m: 1.0\n", "  cell_size_m: 1.0\n  cell_size_m: 2.0\n")
    with pytest.raises(UnreadableFileError, match="duplicate key 'cell_size_m'"):
        load_mission(write(text))


def test_merge_keys_may_be_overridden(write):
    text = """\
        schema: 1
        name: merged
        area: {shape: {kind: box, min_m: [0, 0], max_m: [5, 5]}, cell_size_m: 1}
        fleet:
          agents:
            - &first {id: a1, start_m: [1, 1], sensing_radius_m: 1, input_max_m_per_s2: 1, speed_max_m_per_s: 1}
            - {<<: *first, id: a2, start_m: [3, 3]}
        """
    mission = load_mission(write(text))
    assert mission.fleet.ids == ("a1", "a2")
    np.testing.assert_array_equal(mission.fleet.speed_max, [1, 1])


@pytest.mark.parametrize("value", [".nan", ".inf", "-.inf", "1e400", "yes", "~", "[1]", "{a: 1}", "2024-01-01"])
def test_what_yaml_calls_a_value_is_not_always_a_number(write, value):
    text = yaml.safe_dump(raw_mission()).replace("cell_size_m: 1.0", f"cell_size_m: {value}")
    with pytest.raises(InvalidInputError) as caught:
        load_mission(write(text))
    assert "area.cell_size_m" in {problem.path for problem in caught.value.problems}


@pytest.mark.parametrize("raw", [None, 3, "box", [], [1], {}, {1: 2}, {(1, 2): 3}, True])
def test_what_is_no_mapping_is_no_mission(raw):
    with pytest.raises(InvalidInputError):
        build_mission(raw, "test")


def test_an_empty_file(write):
    with pytest.raises(InvalidInputError, match="the file: None: must be a mapping"):
        load_mission(write(""))


def test_aliases_that_blow_up_or_bite_their_tail_are_harmless(write):
    lines = ["a0: &a0 [x, x, x, x, x, x, x, x, x]"]
    lines += [f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9)}]" for i in range(1, 30)]
    lines += ["area: *a29", "fleet: &me {agents: [*me]}"]
    with pytest.raises(InvalidInputError, match="area: ") as caught:
        load_mission(write("\n".join(lines)))
    assert len(str(caught.value)) < 10_000


def test_a_strange_key_does_not_spoil_the_terminal():
    with pytest.raises(InvalidInputError) as caught:
        build_mission(raw_mission() | {"a\x1b[31m\n": 1}, "test")
    assert "a\\x1b[31m\\n: 1: is not a known key" in str(caught.value)


def test_json_round_trip():
    mission = load_mission("box-3")
    again = mission_from_json(mission.to_json(), "test")
    assert again.spec == mission.spec
    assert again.to_json() == mission.to_json()


@pytest.mark.parametrize("text", ["", "{", "[" * 100_000, "{} x"])
def test_broken_json_is_refused(text):
    with pytest.raises(UnreadableFileError, match="holds no readable mission"):
        mission_from_json(text, "test")


def test_a_problem_is_one_short_line():
    text = str(Problem("a.b", list(range(1000)), "must be short"))
    assert text == "a.b: [0, 1, 2, 3, 4, 5, ...]: must be short"
    assert len(str(Problem("a", "x" * 1000, "b"))) < 100


def test_problems_are_counted():
    one, two = InvalidInputError("f", [Problem("a", 1, "b")]), InvalidInputError("f", [Problem("a", 1, "b")] * 2)
    assert str(one) == "f: 1 problem\n  a: 1: b"
    assert str(two).startswith("f: 2 problems\n")
