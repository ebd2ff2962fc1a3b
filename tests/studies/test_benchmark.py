"""`mpc-cover bench planner`: rows, ratios, files, and what the command line refuses."""

from __future__ import annotations

import csv
import json

import pytest
import yaml
from bench_missions import small_mission
from typer.testing import CliRunner

from mpc_cover.cli import app
from mpc_cover.errors import UserError
from mpc_cover.studies.benchmark import (
    Race,
    RaceProgress,
    as_dict,
    curves_of,
    guesses_of,
    rows_of,
    run_benchmark,
    write_benchmark,
)
from mpc_cover.studies.case import make_case, start_from
from mpc_cover.studies.race import Failure, Limit, Run
from mpc_cover.studies.verdict import judge
from mpc_cover.studies.watch import Answer, Sighting


@pytest.fixture(scope="module")
def mission():
    return small_mission({"duration_s": 3.0})


@pytest.fixture(scope="module")
def race(mission):
    """Ours, another that takes three times as long, and one that is not there."""
    case = make_case(mission)
    rest, sweep = start_from(case, "rest"), start_from(case, "boustrophedon")
    runs = []
    for name, factor in (("ours-native", 1.0), ("slsqp", 3.0)):
        run = Run(name)
        for message in (
            0.25,
            Sighting(0.0, rest, judge(case, rest)),
            Sighting(factor, sweep, judge(case, sweep)),
            Answer(sweep, 5, "done", 2.0 * factor),
        ):
            run.take(message)
        runs.append(run)
    missing = Run("ipopt-min")
    missing.take(Failure("not installed: pip install 'mpc-cover[peers]'"))
    return Race("rest", judge(case, rest), (*runs, missing))


def test_times_are_compared_with_ours(race):
    ours, other, missing = rows_of(race)
    assert (ours.ratio, other.ratio, missing.ratio) == (1.0, 3.0, None)
    assert other.time_s == 6.0
    assert other.best_at_s == 3.0
    assert other.setup_s == 0.25
    assert missing.cost_m is None
    assert "not installed" in missing.status
    without = rows_of(Race(race.guess, race.before, race.runs[1:]))
    assert without[0].ratio is None


def test_curves_go_down(race):
    curves = curves_of(race)
    assert [curve.name for curve in curves] == ["ours-native", "slsqp"]
    for curve in curves:
        assert curve.cost_m == sorted(curve.cost_m, reverse=True)
        assert len(curve.time_s) == len(curve.cost_m) == 2


def test_files_hold_what_the_table_shows(race, mission, tmp_path):
    files = write_benchmark(tmp_path / "new", mission, [race], Limit(7.0))
    assert [file.name for file in files] == ["bench.json", "bench.csv", "bench-rest.png"]
    report = json.loads(files[0].read_text())
    assert report == as_dict(mission, [race], Limit(7.0))
    assert [row["name"] for row in report["guesses"][0]["peers"]] == ["ours-native", "slsqp", "ipopt-min"]
    history = report["guesses"][0]["history"]["slsqp"]
    assert history["time_s"] == [0.0, 3.0]
    assert {len(column) for column in history.values()} == {2}
    with files[1].open() as file:
        rows = list(csv.DictReader(file))
    assert rows[1]["guess"] == "rest"
    assert float(rows[1]["ratio"]) == 3.0
    assert files[2].read_bytes().startswith(b"\x89PNG")


def test_a_folder_that_cannot_be_written(race, mission, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(UserError, match="cannot be written"):
        write_benchmark(tmp_path / "file", mission, [race], Limit(7.0))


def test_guesses_by_name():
    assert guesses_of("all") == ("boustrophedon", "rest")
    assert guesses_of("rest") == ("rest",)
    with pytest.raises(UserError, match="boustrophedon, rest or all"):
        guesses_of("tour")


def test_everyone_gets_the_same_guess(mission):
    told, limit = Told(), Limit(30.0)
    races = run_benchmark(mission, "all", "ours-native", limit, RaceProgress(told, limit))
    assert [race.guess for race in races] == ["boustrophedon", "rest"]
    for race in races:
        assert race.runs[0].seen[0][1] == race.before
    assert told.begun == [("from boustrophedon, 1 of 1: ours-native", 30.0), ("from rest, 1 of 1: ours-native", 30.0)]
    assert told.shown[0] == "sets up"
    assert told.shown[-1].startswith("J = 0 m at ")


def test_progress_compares_with_those_before(race):
    told = Told()
    RaceProgress(told, Limit(30.0, cpu_time=True)).starts("slsqp", "from rest, 2 of 2", race.runs[:1])
    assert told.begun == [("from rest, 2 of 2: slsqp", None)], "how much wall time that takes is not known"
    assert told.shown[0].startswith("sets up; best so far ours-native, J = ")


class Told:
    """Stands in for a line of progress."""

    def __init__(self):
        self.begun, self.shown = [], []

    def begin(self, what, limit_s=None):
        self.begun.append((what, limit_s))

    def show(self, text, part=None):
        self.shown.append(text)


@pytest.fixture
def file(mission, tmp_path):
    path = tmp_path / "small.yaml"
    path.write_text(yaml.safe_dump(mission.spec.model_dump(mode="json", by_alias=True, exclude_none=True)))
    return str(path)


def test_the_command_prints_a_table_and_json(file, tmp_path):
    arguments = [
        "bench",
        "planner",
        file,
        "--guess",
        "rest",
        "--peers",
        "ours-native",
        "--cpu-time",
        "--json",
        "--out",
        str(tmp_path),
    ]
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 0, result.output
    report = json.loads(result.stdout)
    assert (report["mission"], report["clock"]) == ("small", "processor")
    assert report["guesses"][0]["peers"][0]["cost_m"] < report["guesses"][0]["J_m"]
    assert "ours-native" in result.stderr
    assert {"bench.json", "bench.csv", "bench-rest.png"} <= {each.name for each in tmp_path.iterdir()}


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (["--guess", "tour"], "--guess"),
        (["--peers", "snopt"], "snopt"),
        (["--time-limit", "0"], "--time-limit"),
        (["--time-limit", "nan"], "--time-limit"),
        (["--out", "/dev/null/x"], "--out"),
    ],
)
def test_mistakes_are_told_before_the_work(file, wrong, words):
    result = CliRunner().invoke(app, ["bench", "planner", file, *wrong])
    assert isinstance(result.exception, UserError)
    assert words in str(result.exception)


def test_the_step_command_prints_the_parts(file):
    result = CliRunner().invoke(app, ["bench", "step", file, "--json"])
    assert result.exit_code == 0, result.output
    parts = json.loads(result.stdout)
    assert parts["step"]["share"] == pytest.approx(1.0)
    assert "verification" in result.stderr
    wrong = CliRunner().invoke(app, ["bench", "step", file, "--backend", "gurobi"])
    assert isinstance(wrong.exception, UserError)
