"""`--controller potential`, `size`, `study thesis` and `study laws`: what they print, exit statuses, refusals."""

import json
from pathlib import Path

import numpy as np
import pytest
import yaml
from tiny_mission import TINY

from mpc_cover.distributed.setup import check_flyable
from mpc_cover.mission.load import load_mission, shipped_missions
from mpc_cover.studies.measure import coverage_curve
from mpc_cover.trajectory_file import load_trajectory

WIDE = {**TINY, "fleet": {**TINY["fleet"], "communication_range_m": 4.0}}


@pytest.fixture
def run(run):
    """Return a function that runs a command line in a folder with a mission: exit status, stdout, stderr."""
    Path("tiny.yaml").write_text(yaml.safe_dump(WIDE))
    return run


def test_simulate_without_a_controller(run):
    status, out, _ = run("simulate", "tiny.yaml", "--controller", "potential", "--out", "r", "--json", "--seed", 3)
    data = json.loads(out)
    assert status == 0
    assert data["complete"]
    assert data["covered_percent"] == 100.0
    assert data["controller"] == "potential"
    assert data["outcome"] == "everything is covered"
    assert data["messages"] > 0
    assert run("check", "r")[0] == 0


def test_a_study_flies_the_potential_law_that_simulate_flies(run):
    law = {"alpha": 2.5, "core_m": 0.2, "random_part": 0.2, "patience_s": 4.0, "repel_within_m": 1.2}
    Path("own.yaml").write_text(yaml.safe_dump({**WIDE, "potential": law}))
    run("simulate", "own.yaml", "--controller", "potential", "--seed", 0, "--out", "r")
    run("study", "horizon", "own.yaml", "--controllers", "potential", "--starts", "mission", "--seeds", 1, "--out", "s")
    (file,) = Path("s/runs").iterdir()
    record, flown = json.loads(file.read_text()), load_trajectory("r/trajectory.npz")
    assert record["curve_s"] == list(coverage_curve(flown.covered_at))
    assert record["duration_s"] == flown.time[-1] - flown.time[0]
    assert record["effort_m2_per_s3"] == float(np.diff(flown.time) @ (flown.input**2).sum(axis=(1, 2)))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["simulate", "tiny.yaml", "--controller", "pid"], "--controller pid: is none: must be one of mpc, potential"),
        (["demo", "fig-5-1"], "fleet.dynamics single: plans are for double integrators"),
        (["simulate", "fig-5-1"], "fly it with --controller potential"),
        (["agent", "fig-5-1", "--id", "a1"], "fly it with --controller potential"),
        (["plan", "fig-5-1"], "fly it with --controller potential"),
        (["serve", "fig-5-1"], "fly it with --controller potential"),
        (["bench", "planner", "fig-5-1"], "fly it with --controller potential"),
        (["bench", "step", "fig-5-1"], "fly it with --controller potential"),
        (["bench", "step", "tiny.yaml", "--backend", "gurobi"], "--backend gurobi: is none: must be one of"),
        (["simulate", "tiny.yaml", "--controller", "potential", "--backend", "osqp"], "solves no QP"),
        (["demo", "tiny.yaml", "--controller", "potential", "--backend", "piqp"], "solves no QP"),
        (["plan", "tiny.yaml", "--all", "."], "both given: plan one mission, or a folder"),
        (["plan", "tiny.yaml", "--out", "/proc/plan.npz"], "--out /proc/plan.npz: cannot be written"),
        (["agent", "tiny.yaml", "--id", "zz", "--controller", "potential"], "its agents are a1, a2"),
        (["simulate", "near.yaml", "--controller", "potential"], "communication range 2 m: must be at least"),
        (["simulate", "patrol", "--controller", "potential"], "information.kind ageing"),
        (["demo", "patrol", "--controller", "potential"], "which on a patrol never is: fly it by the receding horizon"),
        (["agent", "patrol", "--id", "a1", "--controller", "potential"], "information.kind ageing"),
    ],
)
def test_what_cannot_fly_is_refused_before_anything_is_written(refused, tmp_path, arguments, message):
    near = {**WIDE, "fleet": {**WIDE["fleet"], "communication_range_m": 2.0}}
    Path("near.yaml").write_text(yaml.safe_dump(near))
    before = sorted(tmp_path.iterdir())
    assert message in refused(*arguments)
    assert sorted(tmp_path.iterdir()) == before


def test_size_answers_and_draws(run):
    status, out, _ = run("size", "--rate", 0.1, "--agents", "8", "--seeds", 1, "--out", "s")
    assert status == 0
    assert "0.1 Hz takes 12 agents" in out
    assert "N =   8, potential law, 1 seeds: a round of" in out
    assert {path.name for path in Path("s").iterdir()} == {"figure-1.1.png", "figure-1.2.png", "size.json"}
    saved = json.loads(Path("s/size.json").read_text())
    assert saved["agents_needed"] == 12
    assert 0.0 < saved["potential"][0]["model_mean_absolute_error"] < 0.5


def test_size_by_the_model_alone_is_json(run):
    status, out, _ = run("size", "--agents", "1,100000", "--seeds", 0, "--json")
    data = json.loads(out)
    assert status == 0
    assert [row["agents"] for row in data["table"]] == [1, 100000]
    assert data["table"][1]["rate_hz"] is None, "everything is seen at rest"
    assert data["potential"] == []


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--area", -1], "--area: -1.0: must be greater than 0"),
        (["--area", "nan"], "--area"),
        (["--radius", 7], "--radius: 7.0: its disc must be smaller"),
        (["--speed", 3], "--speed: 3.0: must be at most 2"),
        (["--cover", 1], "--cover: 1.0: must be greater than 0 and less than 1"),
        (["--rate", 0], "--rate: 0.0: must be a number of Hz greater than 0"),
        (["--rate", "inf"], "--rate: inf"),
        (["--agents", "x"], "--agents x: must be whole numbers"),
        (["--agents", ","], "--agents: is empty"),
        (["--agents", "0"], "--agents: 0: must be between 1 and 200"),
        (["--agents", "150"], "see the wanted part at rest"),
        (["--area", "1e8"], "cells to simulate"),
    ],
)
def test_sizes_that_make_no_sense(refused, arguments, message):
    assert message in refused("size", *arguments)


def test_an_answer_that_cannot_be_written_is_refused_before_the_work(refused):
    Path("taken").write_text("a file")
    assert "--out taken: cannot be made" in refused("size", "--out", "taken")


def test_a_figure_of_the_thesis_and_its_seeds(run):
    status, out, _ = run("study", "thesis", "--only", "5.2", "--seeds", 2, "--jobs", 1, "--out", "t")
    assert status == 0
    assert "fig-5-1 (5.1, 5.2): 2 of 2 seeds covered everything" in out
    page = Path("t/index.html").read_text()
    assert page.count("data:image/png;base64,") == 2
    assert "mpc-cover study thesis --only fig-5-1 --seed 1 --out thesis" in page
    assert "Nothing failed" in page or "nothing failed" in page
    made = Path("t/parts/fig-5-1/part.json").stat().st_mtime_ns
    status, out, _ = run("study", "thesis", "--only", "fig-5-1", "--seeds", 2, "--jobs", 1, "--out", "t")
    assert "1 of 1 parts are there already" in out
    assert Path("t/parts/fig-5-1/part.json").stat().st_mtime_ns == made
    assert len(Path("t/seeds/fig-5-1.jsonl").read_text().splitlines()) == 2


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["thesis", "--only", "9.9", "--out", "t"], "--only 9.9: is no figure of ours: must be among sizing, 1.1"),
        (["thesis", "--only", "5.1", "--out", "tiny.yaml"], "--out tiny.yaml: cannot be written"),
        (["laws", "fig-5-1"], "the laws are compared on double integrators"),
        (["laws", "tiny.yaml", "--starts", "x"], "--starts x: must be random or mission"),
        (["laws", "tiny.yaml", "--backend", "x"], "--backend x: is none"),
        (["laws", "tiny.yaml", "--out", "tiny.yaml"], "--out tiny.yaml: cannot be made"),
        (["laws", "none.yaml"], "no such file"),
        (["laws", "tiny.yaml", "patrol"], "information.kind ageing"),
    ],
)
def test_studies_that_cannot_be(refused, arguments, message):
    assert message in refused("study", *arguments)


def test_laws_side_by_side(run):
    Path("short.yaml").write_text(yaml.safe_dump({**WIDE, "control": {"planning_time_s": 1.0}}))
    status, out, err = run("study", "laws", "short.yaml", "--seeds", 1, "--jobs", 1, "--out", "l", "--json")
    assert status == 0
    runs = {each["law"]: each for each in json.loads(out)["runs"]}
    assert set(runs) == {"mpc", "potential"}
    for each in runs.values():
        assert each["complete"]
        assert each["violations"] == 0
        assert min(each[name] for name in ("messages", "bytes", "compute_ms", "distance_m", "effort_m2_per_s3")) > 0.0
        assert each["time_to_95_s"] <= each["time_to_99_s"] <= each["time_to_100_s"]
    assert "receding horizon" in err
    assert len(Path("l/laws.csv").read_text().splitlines()) == 3


def test_both_laws_fly_a_kalman_mission(run):
    information = {"kind": "kalman", "noise_variance": 1.0, "prior_variance": 4.0, "target_variance": 0.5}
    control = {"planning_time_s": 1.0}
    Path("k.yaml").write_text(yaml.safe_dump({**WIDE, "information": information, "control": control}))
    status, out, _ = run("study", "laws", "k.yaml", "--seeds", 1, "--jobs", 1, "--json")
    assert status == 0
    assert {each["law"]: each["covered_percent"] for each in json.loads(out)["runs"]} == {"mpc": 100, "potential": 100}
    status, out, _ = run("simulate", "k.yaml", "--controller", "potential", "--json", "--out", "r")
    assert status == 0
    assert len(json.loads(out)["estimate_rms_errors"]) == 2
    assert run("check", "r")[0] == 0


FIGURES = {"fig-5-1", "fig-5-3", "fig-6-2", "fig-6-4"}


def test_every_simulation_of_chapters_5_and_6_has_a_mission():
    here = {path.stem for path in shipped_missions() if path.parent.name == "thesis-potential"}
    assert here == FIGURES


@pytest.mark.parametrize("name", sorted(FIGURES))
def test_every_one_of_them_has_a_twin_that_differs_in_its_dynamics_only(name):
    single, double = load_mission(name).spec, load_mission(f"{name}-double").spec
    assert (single.fleet.dynamics, double.fleet.dynamics) == ("single", "double")
    for section in ("area", "information", "potential", "looks"):
        assert getattr(single, section) == getattr(double, section)
    assert single.fleet.agents == double.fleet.agents
    assert single.control.period_s == double.control.period_s
    assert single.fleet.model_copy(update={"dynamics": "double", "defaults": double.fleet.defaults}) == double.fleet
    check_flyable(load_mission(f"{name}-double"))
