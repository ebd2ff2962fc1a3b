"""`mpc-cover plan`: what it writes, which `plot` draws, and where it cannot."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from mpc_cover.planning.offline import plan_mission
from mpc_cover.trajectory_file import load_trajectory


@pytest.mark.parametrize(
    ("out", "words"),
    [("plan.txt", "must end in .npz"), ("no/plan.npz", "cannot be written"), ("/proc/plan.npz", "cannot be written")],
)
def test_a_plan_that_cannot_be_written(refused, out, words):
    assert words in refused("plan", "box-3", "--out", out)


def test_one_mission_or_a_folder(refused):
    assert "both given: plan one mission, or a folder" in refused("plan", "box-3", "--all", ".")


def test_a_plan_that_the_verifier_refuses_is_not_written(run, quick, tmp_path, monkeypatch):
    assert run("plan", quick, "--out", "p.npz")[0] == 0
    before = (tmp_path / "p.npz").read_bytes()

    def through_the_wall(mission, options=None, on_progress=None):
        plan = plan_mission(mission, options, on_progress)
        return replace(plan, position=plan.position + 100.0)

    monkeypatch.setattr("mpc_cover.studies.plans.plan_mission", through_the_wall)
    status, out, err = run("plan", quick, "--out", "p.npz", "--overwrite", "--json")
    assert (status, json.loads(out)["file"]) == (1, None)
    assert "not written: it does not pass the verifier" in err
    assert (tmp_path / "p.npz").read_bytes() == before
    assert run("plan", quick, "--out", "q.npz")[0] == 1
    assert not (tmp_path / "q.npz").exists()


def test_plan_and_plot(run, quick, tmp_path):
    status, out, err = run("plan", quick, "--out", "p.npz", "--json")
    summary = json.loads(out)
    assert status == 0
    assert "s: covers everything (" in err, "what was found is told there, and nothing but JSON here"
    assert summary["kind"] == "plan"
    assert summary["holds"]
    assert load_trajectory(tmp_path / "p.npz").meta["kind"] == "plan"
    status, out, err = run("plot", "p.npz")
    assert (status, "mpc-cover:" in err) == (0, False)
    files = [Path(line) for line in out.splitlines()]
    assert all(file.read_bytes().startswith(b"\x89PNG") for file in files)
    assert {file.parent for file in files} == {Path("p")}
    assert run("plot", "p.npz", "--out", "elsewhere")[1].startswith("elsewhere")
