"""The folder of a study: what it takes in, what it refuses, and its tables."""

import csv
import json

import pytest
from pyarrow import parquet
from study_fixtures import fly_nothing, never, record_of, tiny_run

from mpc_cover.errors import UserError
from mpc_cover.studies import results
from mpc_cover.studies.record import columns
from mpc_cover.studies.results import StudyFolder


@pytest.fixture
def out(tmp_path):
    return tmp_path / "deep" / "study"


def opened(out, missions=None, command="mpc-cover study"):
    folder = StudyFolder(out, missions or {"tiny": "f1"}, command)
    folder.open()
    return folder


def test_nothing_is_written_before_it_is_opened(out):
    StudyFolder(out, {"tiny": "f1"}, "mpc-cover study")
    assert not out.parent.exists()


def test_what_is_kept_is_there_again(out):
    runs = [tiny_run(seed=seed) for seed in (2, 0, 1)]
    for run in runs:
        opened(out).keep(fly_nothing(run))
    again = opened(out)
    assert again.finished == {run.key for run in runs}
    assert [record.seed for record in again.records] == [0, 1, 2]
    assert not list(out.rglob("*.part"))


def test_a_run_that_broke_off_is_not_finished_and_gives_way_to_one_that_is(out):
    run = tiny_run()
    opened(out).keep(never(run, error="RuntimeError: no"))
    assert opened(out).finished == set()
    assert len(opened(out).records) == 1
    opened(out).keep(record_of(run))
    assert opened(out).finished == {run.key}
    assert len(opened(out).records) == 1


def test_damaged_files_do_not_count(out):
    folder = opened(out)
    folder.keep(record_of(tiny_run()))
    (out / "runs" / "torn.json").write_text('{"key": "a')
    (out / "runs" / "alien.json").write_text('{"key": "a"}')
    (out / "runs" / "half.json.part").write_text("{")
    again = opened(out)
    assert again.damaged == 2
    assert len(again.records) == 1


def test_commands_add_up_each_once(out):
    for command in ("one", "two", "one"):
        folder = opened(out, command=command)
    assert folder.commands == ["one", "two"]
    assert json.loads((out / "study.json").read_text())["missions"] == {"tiny": "f1"}


def test_missions_add_up_but_none_changes(out):
    opened(out)
    opened(out, {"other": "f2"})
    with pytest.raises(UserError, match="holds results of another mission called tiny: give another --out"):
        opened(out, {"tiny": "f3"})
    assert json.loads((out / "study.json").read_text())["missions"] == {"tiny": "f1", "other": "f2"}


def test_results_of_another_version_are_refused(out, monkeypatch):
    opened(out)
    monkeypatch.setattr(results, "__version__", "9.9")
    with pytest.raises(UserError, match=r"holds results made by mpc-cover .*, this is 9.9: give another --out"):
        opened(out)


@pytest.mark.parametrize("content", ["{", "[]", '{"format": 0}'])
def test_another_marker_is_refused(out, content):
    out.mkdir(parents=True)
    (out / "study.json").write_text(content)
    with pytest.raises(UserError, match=r"study\.json is not of this version"):
        opened(out)


def test_a_folder_of_something_else_is_refused_and_left_alone(out):
    out.mkdir(parents=True)
    (out / "thesis.txt").write_text("dear")
    with pytest.raises(UserError, match="is not empty and not a study of mpc-cover"):
        opened(out)
    assert [file.name for file in out.iterdir()] == ["thesis.txt"]


def test_a_place_that_cannot_be_written_is_refused(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(UserError, match="cannot be read: Not a directory"):
        opened(tmp_path / "file")
    with pytest.raises(UserError, match="cannot be written: Not a directory"):
        opened(tmp_path / "file" / "study")
    with pytest.raises(UserError, match="File name too long"):
        opened(tmp_path / ("x" * 300))


def test_a_file_that_cannot_be_written_leaves_nothing_behind(out):
    folder = opened(out)
    (out / "runs.csv").mkdir()
    with pytest.raises(UserError, match=r"runs.csv cannot be written: "):
        folder.write(out / "runs.csv", b"")
    assert not list(out.glob("*.part"))


def test_tables_have_a_row_a_run_and_the_same_columns(out):
    folder = opened(out)
    folder.keep(record_of(tiny_run(seed=1)))
    folder.keep(never(tiny_run("sweep"), connected=False, violated="connectivity -1 m"))
    folder.write_tables()
    table = parquet.read_table(out / "runs.parquet")
    with (out / "runs.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert table.column_names == list(rows[0]) == [name for name, _ in columns()]
    assert table.column("seed").to_pylist() == [1, 0]
    assert table.column("horizon_s").to_pylist() == [4.0, None]
    assert table.column("complete").to_pylist() == [True, False]
    assert table.column("connected").to_pylist() == [None, False]
    assert [row["time_to_99_s"] for row in rows] == ["10.1", ""]
    assert str(table.schema.field("complete").type) == "bool"
    assert str(table.schema.field("ratio_99").type) == "double"
