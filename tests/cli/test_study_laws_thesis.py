"""`mpc-cover study laws` and `mpc-cover study thesis`: what they print and write, and what they refuse."""

import json
from pathlib import Path

import pytest
import yaml
from tiny_mission import WIDE


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
        (["laws", "tiny.yaml", "--out", "tiny.yaml"], "--out tiny.yaml: cannot be written"),
        (["laws", "none.yaml"], "no such file"),
        (["laws", "tiny.yaml", "patrol"], "information.kind ageing"),
    ],
)
def test_studies_that_cannot_be(refused, tiny, arguments, message):
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
