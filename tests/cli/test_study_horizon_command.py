"""`mpc-cover study horizon`: what it prints, its exit status, and that a mistake is one message and exit status 2."""

import json
from pathlib import Path

import numpy as np
import pytest
import yaml
from tiny_mission import TINY, WIDE

from mpc_cover.studies.measure import coverage_curve
from mpc_cover.trajectory_file import load_trajectory


@pytest.fixture
def study(run):
    """Return a function that runs a study in a folder with a mission: exit status, stdout, stderr."""
    Path("tiny.yaml").write_text(yaml.safe_dump(TINY))
    return lambda *arguments: run("study", "horizon", *arguments)


def test_a_study_prints_a_table_and_leaves_its_results(study):
    status, out, _ = study("tiny.yaml", "--controllers", "sweep,potential", "--seeds", 1, "--jobs", 1, "--out", "s")
    assert status == 0
    assert "2 runs; results in s" in out
    assert "tiny: swath bound 2.1 s" in out
    assert "mpc-cover study horizon tiny.yaml --controllers sweep,potential" in Path("s/report.html").read_text()
    assert len(Path("s/runs.csv").read_text().splitlines()) == 3


def test_json_is_all_there_is_on_stdout(study):
    arguments = ("tiny.yaml", "--horizons", "6,4s", "--seeds", 1, "--jobs", 1, "--out", "s", "--json")
    status, out, err = study(*arguments, "--starts", "mission")
    data = json.loads(out)
    assert status == 0
    assert data["folder"] == "s"
    assert (data["wanted"], data["finished"], data["interrupted"]) == (2, 2, False)
    assert [(group["horizon_steps"], group["horizon_s"]) for group in data["groups"]] == [(6, 3.0), (8, 4.0)]
    assert all(group["complete_percent"] == 100.0 and group["violations"] == 0 for group in data["groups"])
    assert "swath bound" in err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--seeds", 0], "--seeds 0: must be at least 1"),
        (["--horizons", ""], "--horizons: is empty"),
        (["--horizons", "2"], "control.horizon_steps: 2: must be at least 4: a1 brakes in 2 steps"),
        (["--periods", "x"], "--periods x: must be numbers of seconds"),
        (["--periods", ","], "--periods: is empty"),
        (["--controllers", "pid"], "--controllers pid: is none"),
        (["--backends", "piqp,qp"], "--backends qp: is none"),
        (["--starts", "here"], "--starts here: must be one of random, mission"),
        (["--dask", "tcp://127.0.0.1:1", "--jobs", 2], "--jobs and --dask are both given"),
        (["--dask", "nowhere"], "--dask"),
    ],
)
def test_a_mistake_is_one_message_and_nothing_is_written(study, arguments, message):
    status, out, err = study("tiny.yaml", "--out", "s", *arguments)
    assert status == 2
    assert not out
    assert err.startswith("mpc-cover: ")
    assert message in err
    assert "Traceback" not in err
    assert not Path("s").exists()


def test_a_study_flies_the_potential_law_that_simulate_flies(run, study):
    law = {"alpha": 2.5, "core_m": 0.2, "random_part": 0.2, "patience_s": 4.0, "repel_within_m": 1.2}
    Path("own.yaml").write_text(yaml.safe_dump({**WIDE, "potential": law}))
    run("simulate", "own.yaml", "--controller", "potential", "--seed", 0, "--out", "r")
    study("own.yaml", "--controllers", "potential", "--starts", "mission", "--seeds", 1, "--out", "s")
    (file,) = Path("s/runs").iterdir()
    record, flown = json.loads(file.read_text()), load_trajectory("r/trajectory.npz")
    assert record["curve_s"] == list(coverage_curve(flown.covered_at))
    assert record["duration_s"] == flown.time[-1] - flown.time[0]
    assert record["effort_m2_per_s3"] == float(np.diff(flown.time) @ (flown.input**2).sum(axis=(1, 2)))


def test_a_folder_of_something_else_is_refused(study):
    Path("s").mkdir()
    Path("s/notes.txt").write_text("mine")
    status, _, err = study("tiny.yaml", "--out", "s", "--controllers", "sweep", "--seeds", 1)
    assert status == 2
    assert "--out s: is not empty and not a study of mpc-cover" in err
    assert [file.name for file in Path("s").iterdir()] == ["notes.txt"]
