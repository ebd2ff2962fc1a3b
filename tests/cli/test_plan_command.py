"""`mpc-cover plan`: what it writes, which `plot` draws, and where it cannot."""

import json
from pathlib import Path

import pytest

from mpc_cover.trajectory_file import load_trajectory


@pytest.mark.parametrize(
    ("out", "words"),
    [("plan.txt", "must end in .npz"), ("no/plan.npz", "cannot be written"), ("/proc/plan.npz", "cannot be written")],
)
def test_a_plan_that_cannot_be_written(refused, out, words):
    assert words in refused("plan", "box-3", "--out", out)


def test_one_mission_or_a_folder(refused):
    assert "both given: plan one mission, or a folder" in refused("plan", "box-3", "--all", ".")


def test_plan_and_plot(run, quick, tmp_path):
    status, out, _ = run("plan", quick, "--out", "p.npz", "--json")
    summary = json.loads(out)
    assert status == 0
    assert summary["kind"] == "plan"
    assert summary["holds"]
    assert load_trajectory(tmp_path / "p.npz").meta["kind"] == "plan"
    status, out, err = run("plot", "p.npz")
    assert (status, err) == (0, "")
    files = [Path(line) for line in out.splitlines()]
    assert all(file.read_bytes().startswith(b"\x89PNG") for file in files)
    assert {file.parent for file in files} == {Path("p")}
    assert run("plot", "p.npz", "--out", "elsewhere")[1].startswith("elsewhere")
