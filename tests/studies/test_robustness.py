"""The robustness study: its table, its verdict, and what becomes of a study that is stopped or flown in parts."""

import io
import json

import msgspec
import pytest
from rich.console import Console
from study_fixtures import record_of

from mpc_cover.errors import UserError
from mpc_cover.studies.executors import LocalExecutor
from mpc_cover.studies.robustness import run_robustness
from mpc_cover.studies.robustness_cases import cases

ONLY = ("box",)


def quick(run):
    """Stand in for a flight that covers everything fast."""
    return record_of(run, time_to_99_s=7.0, time_to_100_s=7.5)


def slow_when_scaled(run):
    return quick(run) if "scaled" not in run.name else record_of(run, time_to_99_s=70.0, time_to_100_s=75.0)


def never(run):
    return record_of(run, complete=False, time_to_99_s=None, time_to_100_s=None)


@pytest.fixture
def study(tmp_path):
    """Return a function that runs the study of the box: its result and what it printed."""

    def study(fly=quick, only=ONLY):
        text = io.StringIO()
        console = Console(file=text, width=120)
        found = run_robustness(only, tmp_path / "out", LocalExecutor(1), console, command="mpc-cover", fly=fly)
        return found, text.getvalue()

    return study


def test_every_kind_of_change_is_flown_at_least_two_hundred_missions_in_all():
    all_cases = cases()
    assert len(all_cases) >= 200
    assert len({case.mission.spec.name for case in all_cases}) == len(all_cases)
    assert {case.change for case in all_cases} > {"as it is", "moved", "scaled", "turned", "renumbered", "period"}


def test_all_pass(study):
    found, said = study()
    assert found.exit_status == 0
    assert f"{len(found.results)} of {len(found.results)} cases pass" in said
    assert all(file.is_file() for file in found.files)
    assert {"robustness.html", "robustness.png", "runs.csv"} <= {file.name for file in found.files}


def test_one_slow_kind_fails_the_study(study):
    found, said = study(slow_when_scaled)
    assert found.exit_status == 1
    assert {result.case.change for result in found.results if not result.passes} == {"scaled"}
    assert "box scaled" in said


def test_what_is_never_covered_is_unfinished(study):
    found, said = study(never)
    assert found.exit_status == 1
    assert "never" in said
    assert json.dumps(found.to_dict(), allow_nan=False)


def test_a_second_study_flies_nothing_again(study):
    study()

    def refuse(run):
        raise AssertionError(run.name)

    found, said = study(refuse)
    assert found.exit_status == 0
    assert "already there" in said


def test_a_violation_does_not_pass(study):
    found, _ = study(lambda run: msgspec.structs.replace(quick(run), violations=1, violated="separation"))
    assert found.exit_status == 1


def test_an_unknown_row_is_refused(study):
    with pytest.raises(UserError, match="--only sphere: is none: must be among"):
        study(only=("sphere",))
