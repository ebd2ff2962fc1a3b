"""The penalised form is the problem that everyone is judged by: its motion, J, derivatives, and what it punishes."""

from __future__ import annotations

import numpy as np
import pytest
from bench_missions import closed_mission, ended_mission, small_mission, two_magnitudes, wiggled

from mpc_cover.coverage.majoriser import Softness, soft_cost
from mpc_cover.mission.load import build_mission
from mpc_cover.studies.case import make_case, start_from
from mpc_cover.studies.verdict import judge

pytest.importorskip("jax")

from mpc_cover.studies.peers.jax_ import Penalised

MISSIONS = [small_mission, ended_mission, closed_mission, two_magnitudes]
BETA, MARGIN, SHARPNESS = 20.0, 0.05, 10.0


def value(form, x, edges):
    return form.value_and_gradient(x, BETA, MARGIN, SHARPNESS, edges)[0]


@pytest.mark.parametrize("mission", MISSIONS)
def test_its_derivative_is_that_of_differences(mission):
    case = make_case(mission())
    form, x = Penalised(case), wiggled(case)
    edges, rng = form.edges(x), np.random.default_rng(0)
    _, gradient = form.value_and_gradient(x, BETA, MARGIN, SHARPNESS, edges)
    for _ in range(5):
        along = rng.standard_normal(x.size)
        slope = (value(form, x + 1e-6 * along, edges) - value(form, x - 1e-6 * along, edges)) / 2e-6
        assert gradient @ along == pytest.approx(slope, rel=1e-5, abs=1e-5)


@pytest.mark.parametrize("mission", MISSIONS)
def test_without_violations_it_is_the_soft_cost(mission):
    case = make_case(mission())
    form, x = Penalised(case), start_from(case, "rest")
    assert judge(case, x).holds
    ocp = case.ocp
    position, _ = ocp.motion(x)
    softness = Softness(beta=BETA, margin=MARGIN, count=position[:, :, 0].size)
    hinged = soft_cost(position, ocp.cell, ocp.fleet.radius, ocp.weight, softness) / form.scale
    rounded = np.log(2.0) / BETA * float(ocp.weight.sum()) / form.scale
    assert hinged - 1e-6 * hinged <= value(form, x, form.edges(x)) <= hinged + rounded


def test_what_is_violated_costs_and_more_so_with_the_sharpness():
    case = make_case(small_mission())
    form, rest = Penalised(case), start_from(case, "rest")
    size = case.ocp.fleet.start.size
    fast = rest.copy()
    fast[2 * size : -size] = np.tile([3.0, 0.0], (rest.size - 3 * size) // 2)
    assert not judge(case, case.ocp.exact_ends(fast)).holds_sampled
    edges = form.edges(rest)
    soft, hard = (form.value_and_gradient(fast, BETA, MARGIN, sharpness, edges)[0] for sharpness in (1.0, 100.0))
    assert hard > soft + 1.0


def test_ends_are_exact_whatever_the_variables_say():
    case = make_case(ended_mission())
    form, x = Penalised(case), wiggled(case)
    edges = form.edges(x)
    moved = x.copy()
    moved[: case.ocp.fleet.start.size] += 1.0
    assert value(form, moved, edges) == pytest.approx(value(form, x, edges))


def test_several_looks_are_refused():
    spec = small_mission().spec.model_dump(by_alias=True, exclude_none=True)
    spec["area"]["looks"] = 3
    with pytest.raises(NotImplementedError, match="several looks"):
        Penalised(make_case(build_mission(spec, "looks")))
