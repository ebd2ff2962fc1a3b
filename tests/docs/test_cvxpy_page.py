"""The page on CVXPY: its example runs, and it has every attribute that a user's function is given."""

import dataclasses
import re
import shlex
import sys
from pathlib import Path

import numpy as np
import yaml
from tiny_mission import TINY

import mpc_cover
from mpc_cover.trajectory_file import load_trajectory

PAGE = (Path(__file__).parents[2] / "docs" / "cvxpy.md").read_text(encoding="utf-8")


def test_the_example_runs_by_the_commands_that_are_shown(run, tmp_path, monkeypatch):
    monkeypatch.setattr(sys, "path", [*sys.path])
    (module,) = re.findall(r"^```python\n(.*?)^```", PAGE, flags=re.DOTALL | re.MULTILINE)
    (tmp_path / "mine.py").write_text(module, encoding="utf-8")
    (tmp_path / "tiny.yaml").write_text(yaml.safe_dump({**TINY, "planning": {"duration_s": 4.0}}), encoding="utf-8")
    plan, check = re.findall(r"^mpc-cover (.*)$", PAGE, flags=re.MULTILINE)
    run(*shlex.split(plan.replace("box-3", "tiny.yaml")), "--starts", "2")
    _, out, _ = run(*shlex.split(check))
    assert re.search(r"keep_out disc +│ yes", out)
    nearest = np.linalg.norm(load_trajectory(tmp_path / "plan.npz").position - [1.5, 1.5], axis=2).min()
    assert nearest >= 0.5 * 0.7 - 1e-4


def test_every_attribute_of_the_motion_is_in_the_table():
    shown = set(re.findall(r"^\| `(\w+)` \|", PAGE, flags=re.MULTILINE))
    assert shown == {field.name for field in dataclasses.fields(mpc_cover.MotionVariables)}


def test_the_attributes_of_the_mission_are_there():
    mission = mpc_cover.load_mission(TINY)
    for owner, names in re.findall(r"`(fleet|field)` \(([^)]*(?:\(K, d\)[^)]*)?)\)", PAGE):
        for name in re.findall(r"`(\w+)`", names):
            assert hasattr(getattr(mission, owner), name), f"{owner}.{name}"
