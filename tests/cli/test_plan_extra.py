"""`plan --formulation cvxpy --extra module:function` and `check --extra`: what is printed, kept and refused."""

import json
import re
import sys

import pytest
import yaml
from tiny_mission import TINY

from mpc_cover.trajectory_file import load_trajectory

PLAN = ("plan", "tiny.yaml", "--formulation", "cvxpy", "--starts", "1", "--out", "p.npz")

WISHES = """
import cvxpy as cp
CORNER = 4.0

def corner(motion, mission):
    return [], {"corner": motion.position[:, :, 0] + motion.position[:, :, 1] <= CORNER}

def nowhere(motion, mission):
    return [], {"west": motion.position[:, 0, 0] <= 0.5, "north": motion.position[:, :, 1] <= 9.0}

def peaks(motion, mission):
    return [cp.sum_squares(motion.input), cp.sqrt(motion.position[1, 0, 0])], []

def farther(motion, mission):
    return [], [motion.position[-1, 0, 1] >= motion.iterate.position[-1, 0, 1] + 0.1]

def slip(motion, mission):
    return [], [motion.position[99] <= 1.0]
"""


@pytest.fixture
def wishes(tmp_path, monkeypatch, request):
    """Write a mission and a module; its name."""
    monkeypatch.setattr(sys, "path", [*sys.path])
    (tmp_path / "tiny.yaml").write_text(yaml.safe_dump({**TINY, "planning": {"duration_s": 3.0}}), encoding="utf-8")
    name = f"wishes_{abs(hash(request.node.name))}"  # modules are imported once in a process
    (tmp_path / f"{name}.py").write_text(WISHES, encoding="utf-8")
    return name


def checks_of(out):
    return {check["name"]: check for check in json.loads(out)["checks"]}


def test_a_plan_keeps_the_constraint_and_the_file_says_what_it_was_made_with(wishes, run, tmp_path):
    extra = f"{wishes}:corner"
    status, out, err = run(*PLAN, "--extra", extra, "--json")
    said = json.loads(out)
    assert status == 1  # the corner stays uncovered
    assert said["holds"]
    assert (said["extra"], said["formulation"], said["cvxpy"]["solver"]) == (extra, "cvxpy", "CLARABEL")
    assert said["cvxpy"]["statuses"]["optimal"] == said["subproblems"]
    assert f"CVXPY (CLARABEL): {said['subproblems']} optimal" in err
    assert "corner corner: holds" in err
    meta = load_trajectory(tmp_path / "p.npz").meta
    assert (meta["extra"], meta["formulation"], meta["cvxpy"]) == (extra, "cvxpy", said["cvxpy"])
    assert f"planned with --extra {extra}" in run("check", "p.npz")[1].replace("\n", "")
    status, out, err = run("check", "p.npz", "--extra", extra, "--json")
    line = checks_of(out)["corner corner"]
    assert line["holds"]
    assert abs(line["margin"]) < 1e-5
    assert "planned with" not in err


def test_check_tells_by_how_much_and_where_a_constraint_is_violated(wishes, run):
    assert run(*PLAN)[0] == 0
    status, out, _ = run("check", "p.npz", "--extra", f"{wishes}:nowhere", "--json")
    west, north = (checks_of(out)[f"nowhere {name}"] for name in ("west", "north"))
    assert status == 1
    assert not json.loads(out)["holds"]
    assert not west["holds"]
    assert west["margin"] < -0.2
    assert "t = " in west["where"]
    assert north["holds"]
    assert "FAILS" not in run("check", "p.npz")[1]


def test_flights_are_checked_by_the_same_function(wishes, simulated, run):
    _, out, _ = run("check", "run", "--extra", f"{wishes}:nowhere", "--json")
    assert not checks_of(out)["nowhere west"]["holds"]
    assert checks_of(out)["nowhere north"]["holds"]


def test_a_plan_that_violates_a_constraint_is_not_called_good(wishes, run, tmp_path):
    """It asks for more than the iterate has, whatever that is."""
    status, out, err = run(*PLAN, "--extra", f"{wishes}:farther", "--json")
    assert (status, json.loads(out)["file"], json.loads(out)["holds"]) == (1, None, False)
    assert "farther constraints[0]: FAILS, margin -0.1" in err
    assert "not written: it does not pass the verifier" in err
    assert not (tmp_path / "p.npz").exists()


def test_mistakes_are_one_sentence_each(wishes, refused):
    def said(function):
        return refused(*PLAN, "--extra", f"{wishes}:{function}").replace("\n", " ")

    nowhere = refused(*PLAN, "--extra", "nowhere_at_all:keep")
    assert "extra nowhere_at_all:keep: there is no module nowhere_at_all" in nowhere
    assert f"{wishes} has no keep; it has corner, farther, nowhere, peaks, slip" in said("keep")
    assert re.search(r"terms\[1\]: .*position\[1, 0, 0\].*: is concave, not convex", said("peaks"))
    assert "IndexError: " in said("slip")
    assert f"({wishes}.py, line 18)" in said("slip")
    assert "CVXPY's status is infeasible with them" in said("nowhere")
    assert said("nowhere").endswith("infeasible: west alone ")


def test_options_that_do_not_go_together(wishes, run, refused):
    assert "needs --formulation cvxpy" in refused("plan", "tiny.yaml", "--extra", f"{wishes}:corner")
    assert "formulation lp: must be qp or cvxpy" in refused("plan", "tiny.yaml", "--formulation", "lp")
    assert "no shortest plan" in refused(*PLAN, "--min-time")
    assert "backend gurobi: is none of CVXPY's here" in refused(*PLAN, "--backend", "gurobi")
    assert run(*PLAN)[0] == 0
    assert "there is no module" in refused("check", "p.npz", "--extra", "nowhere_at_all:keep")
