"""What CasADi's solvers are given is the problem that everyone is judged by: values and derivatives."""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np
import pytest
from bench_missions import closed_mission, ended_mission, small_mission, two_magnitudes, wiggled

from mpc_cover.coverage.majoriser import Softness, soft_cost
from mpc_cover.coverage.objective import coverage_cost
from mpc_cover.studies.case import make_case, start_from

with warnings.catch_warnings():
    warnings.simplefilter("ignore")  # SWIG's, on newer Pythons
    cs = pytest.importorskip("casadi")

from mpc_cover.studies.peers.transcription import Transcription


def evaluated(form, name, w, parameters=(5.0, 0.1)):
    function = cs.Function("f", [form.nlp["x"], form.nlp["p"]], [form.nlp[name]])
    return np.asarray(function(w, list(parameters))).ravel()


@pytest.mark.parametrize("mission", [small_mission, ended_mission, closed_mission])
def test_a_feasible_motion_is_feasible_as_transcribed(mission):
    case = make_case(mission())
    form, x = Transcription(case, soft=True), start_from(case, "rest")
    w = form.pack(x)
    assert form.unpack(w) == pytest.approx(x)
    lower, upper = form.row_bounds(x)
    rows = evaluated(form, "g", w)
    assert (rows >= lower - 1e-9).all()
    assert (rows <= upper + 1e-9).all()
    assert (w >= form.lower - 1e-9).all()
    assert (w <= form.upper + 1e-9).all()


def test_what_is_infeasible_is_infeasible_as_transcribed():
    case = make_case(small_mission())
    form = Transcription(case, soft=True)
    velocity = np.zeros((case.ocp.steps + 1, 2, 2))
    velocity[1:-1, 0, 1] = 1.2  # too hard, and too far from the other
    x = case.ocp.decision(case.task.position, velocity)
    lower, upper = form.row_bounds(x)
    rows = evaluated(form, "g", form.pack(x))
    broken = (rows < lower - 1e-9) | (rows > upper + 1e-9)
    assert broken.any()
    dynamics = case.ocp.steps * 4
    assert not broken[:dynamics].any()


@pytest.mark.parametrize("mission", [small_mission, two_magnitudes])
def test_the_symbolic_costs_are_the_numerical_ones(mission):
    case = make_case(mission())
    x = wiggled(case)
    ocp = case.ocp
    position, _ = ocp.motion(x)
    hard = Transcription(case, soft=False)
    exact = coverage_cost(position, ocp.cell, ocp.fleet.radius, ocp.weight)
    assert evaluated(hard, "f", hard.pack(x), (5.0, 0.0)) == pytest.approx(exact, abs=1e-4)
    soft = Transcription(case, soft=True)
    softness = Softness(beta=200.0, margin=0.1, count=1000)
    sharp = soft_cost(position, ocp.cell, ocp.fleet.radius, ocp.weight, softness)
    # softplus lies up to log(2)/beta above pos, at every term
    terms = ocp.weight.size * np.log(2.0) / softness.beta
    assert sharp - 1e-3 <= evaluated(soft, "f", soft.pack(x), (softness.beta, 0.1))[0] <= sharp + terms


def test_the_exact_hessian_is_casadis_own():
    case = make_case(two_magnitudes())
    form = Transcription(case, soft=True)
    w, p = form.nlp["x"], form.nlp["p"]
    multipliers = cs.MX.sym("l", form.nlp["g"].shape[0])
    lagrangian = 2.0 * form.nlp["f"] + cs.dot(multipliers, form.nlp["g"])
    automatic = cs.Function("h", [w, p, multipliers], [cs.hessian(lagrangian, w)[0]])
    point = form.pack(wiggled(case))
    some = np.random.default_rng(1).standard_normal(multipliers.shape[0])
    wanted = np.asarray(cs.DM(automatic(point, [5.0, 0.1], some)).full())
    found = np.asarray(cs.DM(form.hessian(upper_triangle=False)(point, [5.0, 0.1], 2.0, some)).full())
    upper = np.asarray(cs.DM(form.hessian(upper_triangle=True)(point, [5.0, 0.1], 2.0, some)).full())
    assert found == pytest.approx(wanted, abs=1e-8)
    assert upper == pytest.approx(np.triu(wanted), abs=1e-8)


def test_several_looks_are_not_transcribed():
    case = make_case(small_mission())
    ocp = replace(case.ocp, looks=np.full(case.ocp.weight.shape, 2))
    with pytest.raises(NotImplementedError, match="looks"):
        Transcription(replace(case, ocp=ocp), soft=True)
