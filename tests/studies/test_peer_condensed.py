"""The condensed form is the problem that everyone is judged by: values and derivatives."""

from __future__ import annotations

import numpy as np
import pytest
from bench_missions import closed_mission, ended_mission, small_mission, wiggled

from mpc_cover.coverage.majoriser import Softness, soft_cost
from mpc_cover.studies.case import make_case, start_from
from mpc_cover.studies.peers.condensed import Condensed
from mpc_cover.studies.verdict import judge

MISSIONS = [small_mission, ended_mission, closed_mission]


def slope(function, point, step=1e-6):
    """Return the derivative by central differences, (..., n)."""
    steps = step * np.eye(point.size)
    return np.stack([(function(point + each) - function(point - each)) / (2.0 * step) for each in steps], axis=-1)


@pytest.mark.parametrize("mission", MISSIONS)
def test_the_condensed_form_moves_as_the_window_does(mission):
    case = make_case(mission())
    form, x = Condensed(case), wiggled(case)
    assert form.unpack(form.pack(x)) == pytest.approx(x, abs=1e-12)
    matrix, right = form.ends()
    assert matrix @ form.pack(x) == pytest.approx(right, abs=1e-9)
    assert right.size > 0


@pytest.mark.parametrize("mission", MISSIONS)
def test_the_condensed_derivatives_are_those_of_differences(mission):
    case = make_case(mission())
    form, softness = Condensed(case), Softness(beta=5.0, margin=0.1, count=1000)
    v = form.pack(wiggled(case))
    edges = form.edges(v)
    cost, gradient = form.cost(v, softness)
    position, _ = case.ocp.motion(form.unpack(v))
    ocp = case.ocp
    assert cost == pytest.approx(soft_cost(position, ocp.cell, ocp.fleet.radius, ocp.weight, softness))
    assert gradient == pytest.approx(slope(lambda v: form.cost(v, softness)[0], v), abs=1e-5)
    jacobian = slope(lambda v: form.slack(v, edges), v)
    assert form.slack_jacobian(v, edges) == pytest.approx(jacobian, abs=1e-6)


def test_the_condensed_slacks_say_what_the_verifier_says():
    case = make_case(small_mission())
    form = Condensed(case)
    resting = form.pack(start_from(case, "rest"))
    assert (form.slack(resting, form.edges(resting)) > 0.0).all()
    too_fast = np.tile([1.6, 0.0], resting.size // 2)
    assert form.slack(too_fast, form.edges(too_fast)).min() < 0.0
    assert not judge(case, form.unpack(too_fast)).holds_sampled


def test_without_connectivity_there_are_no_edges():
    case = make_case(small_mission(communication_range_m=None, separation_min_m=0.0))
    form = Condensed(case)
    v = form.pack(start_from(case, "rest"))
    assert not form.edges(v).any()
    assert form.slack_jacobian(v, form.edges(v)).shape[0] == form.slack(v, form.edges(v)).size
