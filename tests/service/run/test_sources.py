"""A recording knows of which records it was made."""

import pytest
from flights import box3_flight

from mpc_cover.service.run.sources import SOURCES, check_sources, source_digests


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "agents").mkdir()
    for name in ("a1", "a2"):
        (tmp_path / "agents" / f"{name}.jsonl").write_text(f"what {name} flew\n")
    return tmp_path


@pytest.fixture
def flight(folder):
    flight = box3_flight("demo")
    flight.meta[SOURCES] = source_digests(folder)
    return flight


def test_records_that_are_as_they_were(flight, folder):
    assert check_sources(flight, folder).holds


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("a1", lambda file: file.write_text("something else\n")),
        ("a2", lambda file: file.unlink()),
        ("a3", lambda file: file.write_text("who is this?\n")),
    ],
)
def test_one_that_was_changed_removed_or_added(flight, folder, name, change):
    change(folder / "agents" / f"{name}.jsonl")
    check = check_sources(flight, folder)
    assert not check.holds
    assert check.where == f"{name}.jsonl: changed, removed or added since"


def test_a_file_by_itself_has_none_to_compare(flight, tmp_path):
    assert check_sources(flight, tmp_path / "elsewhere") is None
    assert check_sources(box3_flight(), tmp_path) is None


def test_nonsense_in_their_place(flight, folder):
    flight.meta[SOURCES] = ["a1.jsonl"]
    assert not check_sources(flight, folder).holds
