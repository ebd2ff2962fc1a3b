"""What peers are given to solve is the problem that everyone is judged by: values and derivatives."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from bench_missions import closed_mission, ended_mission, small_mission

from mpc_cover.coverage.majoriser import Softness, soft_cost
from mpc_cover.coverage.objective import coverage_cost
from mpc_cover.mission.load import load_mission
from mpc_cover.studies.case import make_case, start_from
from mpc_cover.studies.peers.condensed import Condensed
from mpc_cover.studies.verdict import judge

pytestmark = pytest.mark.filterwarnings("ignore:builtin type:DeprecationWarning")  # SWIG's, on newer Pythons


def two_magnitudes():
    """Return agents that measure different things with different radii."""
    agents = [
        {"id": "a1", "start_m": [0.5, 0.5], "sensing_radius_m": {"wind": 0.8, "heat": 0.5}},
        {"id": "a2", "start_m": [1.5, 0.5], "sensing_radius_m": {"heat": 1.0}},
    ]
    spec = small_mission().spec.model_dump(by_alias=True, exclude_none=True)
    spec["magnitudes"], spec["fleet"]["agents"] = ["wind", "heat"], agents
    del spec["fleet"]["defaults"]["sensing_radius_m"]
    return spec


MISSIONS = [small_mission, ended_mission, closed_mission]


def wiggled(case, seed=0):
    """Return a decision vector that is nobody's optimum: the sweep with noise on its velocities, ends as asked."""
    rng = np.random.default_rng(seed)
    x = start_from(case, "boustrophedon")
    return case.window.exact_ends(x + 0.05 * rng.standard_normal(x.size))


def slope(function, point, step=1e-6):
    """Return the derivative by central differences, (..., n)."""
    columns = []
    for each in np.eye(point.size):
        columns.append((function(point + step * each) - function(point - step * each)) / (2.0 * step))
    return np.stack(columns, axis=-1)


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
    position, _ = case.window.motion(form.unpack(v))
    window = case.window
    assert cost == pytest.approx(soft_cost(position, window.cell, window.fleet.radius, window.weight, softness))
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


def transcription(case, *, soft):
    pytest.importorskip("casadi")
    from mpc_cover.studies.peers.transcription import Transcription

    return Transcription(case, soft=soft)


def evaluated(form, name, w, parameters=(5.0, 0.1)):
    import casadi as cs

    function = cs.Function("f", [form.nlp["x"], form.nlp["p"]], [form.nlp[name]])
    return np.asarray(function(w, list(parameters))).ravel()


@pytest.mark.parametrize("mission", MISSIONS)
def test_a_feasible_motion_is_feasible_as_transcribed(mission):
    case = make_case(mission())
    form, x = transcription(case, soft=True), start_from(case, "rest")
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
    form = transcription(case, soft=True)
    velocity = np.zeros((case.window.steps + 1, 2, 2))
    velocity[1:-1, 0, 1] = 1.2  # too hard, and too far from the other
    x = case.window.decision(case.task.position, velocity)
    lower, upper = form.row_bounds(x)
    rows = evaluated(form, "g", form.pack(x))
    broken = (rows < lower - 1e-9) | (rows > upper + 1e-9)
    assert broken.any()
    dynamics = case.window.steps * 4
    assert not broken[:dynamics].any()


@pytest.mark.parametrize("name", ["small", "two magnitudes"])
def test_the_symbolic_costs_are_the_numerical_ones(name):
    from mpc_cover.mission.load import build_mission

    case = make_case(small_mission() if name == "small" else build_mission(two_magnitudes(), name))
    x = wiggled(case)
    window = case.window
    position, _ = window.motion(x)
    hard = transcription(case, soft=False)
    exact = coverage_cost(position, window.cell, window.fleet.radius, window.weight)
    assert evaluated(hard, "f", hard.pack(x), (5.0, 0.0)) == pytest.approx(exact, abs=1e-4)
    soft = transcription(case, soft=True)
    softness = Softness(beta=200.0, margin=0.1, count=1000)
    sharp = soft_cost(position, window.cell, window.fleet.radius, window.weight, softness)
    # softplus lies up to log(2)/beta above pos, at every term
    terms = window.weight.size * np.log(2.0) / softness.beta
    assert sharp - 1e-3 <= evaluated(soft, "f", soft.pack(x), (softness.beta, 0.1))[0] <= sharp + terms


def test_the_exact_hessian_is_casadis_own():
    from mpc_cover.mission.load import build_mission

    case = make_case(build_mission(two_magnitudes(), "two magnitudes"))
    form = transcription(case, soft=True)
    import casadi as cs

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
    case = make_case(load_mission("box-3"))
    window = replace(case.window, looks=np.full(case.window.weight.shape, 2))
    pytest.importorskip("casadi")
    with pytest.raises(NotImplementedError, match="looks"):
        transcription(replace(case, window=window), soft=True)
