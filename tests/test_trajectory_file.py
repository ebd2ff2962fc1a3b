"""The trajectory file: what goes in comes out, and nothing broken gets in."""

from __future__ import annotations

import contextlib
import json
import pickle
import zipfile
from dataclasses import replace

import numpy as np
import pytest
from flights import box3_flight, mission_of, trajectory_of
from hypothesis import given, settings
from hypothesis import strategies as st

from mpc_cover.errors import InvalidInputError, UnreadableFileError, UserError
from mpc_cover.mission.load import load_mission
from mpc_cover.trajectory_file import load_trajectory, save_trajectory

ARRAYS = ("time", "position", "velocity", "input", "cell", "covered_at")


@pytest.fixture(scope="module")
def flight():
    return box3_flight()


@pytest.fixture(scope="module")
def saved(flight, tmp_path_factory):
    file = tmp_path_factory.mktemp("saved") / "flight.npz"
    save_trajectory(flight, file)
    return file


def contents(file):
    with np.load(file, allow_pickle=False) as archive:
        return {name: archive[name] for name in archive.files}


def write(file, data):
    np.savez_compressed(file, **data)
    return file


def problems(file):
    with pytest.raises(InvalidInputError) as caught:
        load_trajectory(file)
    return {problem.path: str(problem) for problem in caught.value.problems}


def test_round_trip(flight, saved):
    again = load_trajectory(saved)
    for name in ARRAYS:
        np.testing.assert_array_equal(getattr(again, name), getattr(flight, name))
    assert again.agent_id == flight.agent_id
    assert again.meta == flight.meta
    assert again.mission.spec == flight.mission.spec


def test_saved_twice_is_the_same_file(saved, tmp_path):
    save_trajectory(load_trajectory(saved), tmp_path / "again.npz")
    assert (tmp_path / "again.npz").read_bytes() == saved.read_bytes()


def test_file_has_the_documented_contents(saved):
    data = contents(saved)
    assert set(data) == {*ARRAYS, "agent_id", "meta"}
    assert data["position"].shape == (46, 3, 2)
    assert data["input"].shape == (45, 3, 2)
    assert np.isinf(data["covered_at"]).sum() == 6
    meta = json.loads(str(data["meta"]))
    assert meta["kind"] == "simulate"
    assert meta["mission"]["fleet"]["communication_range_m"] == 5.5


def test_a_name_without_a_suffix_is_kept_as_it_is(flight, tmp_path):
    save_trajectory(flight, tmp_path / "plan.out")
    assert load_trajectory(tmp_path / "plan.out").agent_id == flight.agent_id


@pytest.mark.parametrize("name", ["missing/plan.npz", "nul\0byte.npz", "x" * 300, "."])
def test_a_place_that_cannot_be_written_is_the_users_mistake(flight, tmp_path, name):
    with pytest.raises(UserError, match="cannot be written"):
        save_trajectory(flight, f"{tmp_path}/{name}")
    assert list(tmp_path.iterdir()) == []


def test_a_directory_is_not_overwritten(flight, tmp_path):
    (tmp_path / "run").mkdir()
    with pytest.raises(UserError, match="cannot be written"):
        save_trajectory(flight, tmp_path / "run")
    assert [file.name for file in tmp_path.iterdir()] == ["run"]


def test_a_meta_that_json_has_no_word_for_is_refused_before_anything_is_written(flight, tmp_path):
    with pytest.raises(ValueError, match="JSON"):
        save_trajectory(replace(flight, meta={"speed": np.inf}), tmp_path / "plan.npz")
    assert not (tmp_path / "plan.npz").exists()


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    """The bytes of a small file, and a place to write broken copies of it."""
    raw = json.loads(load_mission("box-3").to_json())
    raw["area"]["cell_size_m"] = 1.25
    file = tmp_path_factory.mktemp("small") / "small.npz"
    save_trajectory(trajectory_of(mission_of(raw), np.zeros((3, 3, 2))), file)
    return file.read_bytes(), file.with_name("broken.npz")


def test_every_truncation_is_refused(small):
    data, torn = small
    for length in range(0, len(data), 10):
        torn.write_bytes(data[:length])
        with pytest.raises(UnreadableFileError, match=r"broken\.npz"):
            load_trajectory(torn)


@given(st.lists(st.tuples(st.floats(0.0, 1.0, exclude_max=True), st.integers(0, 255)), min_size=1, max_size=4))
@settings(max_examples=400)
def test_flipped_bytes_are_refused_or_harmless(small, flips):
    data, file = small
    broken = bytearray(data)
    for where, value in flips:
        broken[int(where * len(broken))] = value
    file.write_bytes(broken)
    with contextlib.suppress(UserError):
        assert load_trajectory(file).agent_id == ("a1", "a2", "a3")


@pytest.mark.parametrize("content", [b"", b"PK", b"not a zip", b"\x93NUMPY\x01\x00", b"\x00" * 4096])
def test_what_is_no_zip_is_refused(tmp_path, content):
    file = tmp_path / "other.npz"
    file.write_bytes(content)
    with pytest.raises(UnreadableFileError, match="cannot be read"):
        load_trajectory(file)


def test_an_array_by_itself_is_refused(tmp_path):
    np.save(tmp_path / "one.npy", np.zeros(3))
    with pytest.raises(UnreadableFileError, match="is not an archive of arrays"):
        load_trajectory(tmp_path / "one.npy")


def test_missing_file_and_directory(tmp_path):
    with pytest.raises(UnreadableFileError, match="No such file"):
        load_trajectory(tmp_path / "none.npz")
    with pytest.raises(UnreadableFileError, match="directory"):
        load_trajectory(tmp_path)
    with pytest.raises(UnreadableFileError, match="null byte"):
        load_trajectory("nul\0byte.npz")


def test_pickles_are_never_opened(saved, tmp_path):
    data = contents(saved)
    file = write(tmp_path / "object.npz", data | {"position": np.array([print, None], dtype=object)})
    with pytest.raises(UnreadableFileError, match="allow_pickle=False"):
        load_trajectory(file)
    (tmp_path / "pickle.npz").write_bytes(pickle.dumps({"time": [0.0]}))
    with pytest.raises(UnreadableFileError):
        load_trajectory(tmp_path / "pickle.npz")


def test_another_archive_says_what_it_lacks(tmp_path):
    file = write(tmp_path / "other.npz", {"time": np.zeros(3), "velocity": np.zeros(3)})
    with pytest.raises(UnreadableFileError, match="lacks position, input, cell, covered_at, agent_id, meta"):
        load_trajectory(file)
    with zipfile.ZipFile(tmp_path / "empty.npz", "w"):
        pass
    with pytest.raises(UnreadableFileError, match="lacks time"):
        load_trajectory(tmp_path / "empty.npz")


@pytest.mark.parametrize("name", ["time", "position", "velocity", "input", "cell"])
@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, 1e300])
def test_a_number_that_is_not_finite_is_named(saved, tmp_path, name, bad):
    data = contents(saved)
    index = tuple(size - 2 if size > 2 else 0 for size in data[name].shape)
    data[name][index] = bad
    found = problems(write(tmp_path / "bad.npz", data))
    assert "must be finite" in found[f"{name}{list(index)}"]


@pytest.mark.parametrize("bad", [np.nan, -np.inf])
def test_covered_at_may_be_inf_but_nothing_worse(saved, tmp_path, bad):
    data = contents(saved)
    data["covered_at"][7] = bad
    assert "inf where never" in problems(write(tmp_path / "bad.npz", data))["covered_at[7]"]


@pytest.mark.parametrize("name", ARRAYS)
def test_wrong_shapes_are_named_with_the_right_one(saved, tmp_path, name):
    data = contents(saved)
    data[name] = data[name][..., None]
    found = problems(write(tmp_path / "bad.npz", data))
    assert "must be (" in found[f"{name}.shape"]


@pytest.mark.parametrize("name", ARRAYS)
def test_words_instead_of_numbers_are_refused(saved, tmp_path, name):
    data = contents(saved)
    data[name] = data[name].astype(str)
    assert problems(write(tmp_path / "bad.npz", data)) == {
        name: f"{name}: {str(data[name].dtype)!r}: must hold numbers"
    }


def test_whole_numbers_are_numbers(saved, tmp_path):
    data = contents(saved)
    data["velocity"] = np.zeros((46, 3, 2), dtype=np.int32)
    assert load_trajectory(write(tmp_path / "ints.npz", data)).velocity.dtype == float


def test_time_must_run_forward(saved, tmp_path):
    data = contents(saved)
    data["time"][5] = data["time"][4]
    assert "must be greater" in problems(write(tmp_path / "bad.npz", data))["time[5]"]


@pytest.mark.parametrize("samples", [0, 1])
def test_a_motion_has_two_samples(saved, tmp_path, samples):
    data = contents(saved)
    for name in ("time", "position", "velocity"):
        data[name] = data[name][:samples]
    data["input"] = data["input"][:0]
    assert "at least two samples" in problems(write(tmp_path / "bad.npz", data))["time"]


@pytest.mark.parametrize(
    "ids", [["a1", "a2", "a4"], ["a1", "a2"], ["a2", "a1", "a3"], [1, 2, 3], [["a1"], ["a2"], ["a3"]], "a1"]
)
def test_agents_must_be_those_of_the_mission(saved, tmp_path, ids):
    data = contents(saved) | {"agent_id": np.array(ids)}
    assert "must be the mission's" in problems(write(tmp_path / "bad.npz", data))["agent_id"]


@pytest.mark.parametrize("meta", ["", "{", "[]", "3", "null", '{"kind": "plan"}', "[" * 5000, '{"mission": 3}x'])
def test_meta_must_be_an_object_with_a_mission(saved, tmp_path, meta):
    file = write(tmp_path / "bad.npz", contents(saved) | {"meta": np.array(meta)})
    with pytest.raises(UnreadableFileError, match="meta"):
        load_trajectory(file)


@pytest.mark.parametrize("mission", [3, None, [], {}, {"schema": 1}, "box-3"])
def test_a_mission_with_mistakes_is_refused(saved, tmp_path, mission):
    file = write(tmp_path / "bad.npz", contents(saved) | {"meta": np.array(json.dumps({"mission": mission}))})
    with pytest.raises(InvalidInputError, match=r"meta\.mission"):
        load_trajectory(file)


def test_everything_at_once(saved, tmp_path):
    data = contents(saved)
    data["position"][1, 2, 0] = np.nan
    data["velocity"] = data["velocity"][:-1]
    data["time"][3] = 0.0
    found = problems(write(tmp_path / "bad.npz", data))
    assert set(found) == {"position[1, 2, 0]", "velocity.shape", "time[3]"}
