"""The assembled QP against the CVXPY reference, and what its answers do."""

from __future__ import annotations

import numpy as np
import pytest
from motions import random_window, replace, settings

from mpc_cover.constraints.boundary import Ends
from mpc_cover.planning.coverage_nlp import CoverageNLP
from mpc_cover.planning.ocp import requirements
from mpc_cover.planning.reference import build_reference
from mpc_cover.planning.subproblem import build_subproblem
from solvers.backends.base import Options
from solvers.backends.registry import make_backend

TIGHT = {
    "osqp": Options(tolerance=1e-4, max_iterations=200_000),
    "clarabel": Options(tolerance=1e-9),
    "piqp": Options(tolerance=1e-9),
}

CLOSE = {"osqp": 1e-3, "clarabel": 1e-5, "piqp": 1e-5}
"""Relative: a first-order method at a tolerance that it reaches."""


def with_ends(ocp, x, kind):
    """Return the window with other ends that the motion of `x` satisfies."""
    position, velocity = ocp.motion(x)
    ends = {
        "rest": ocp.ends,
        "fixed": replace(ocp.ends, end_position=position[-1], end_velocity=velocity[-1]),
        "free": Ends(),
        "closed": Ends(closed=True),
    }
    return replace(ocp, ends=ends[kind])


@pytest.mark.parametrize("backend", ["osqp", "clarabel", "piqp"])
@pytest.mark.parametrize(
    ("seed", "agents", "dimension", "kind"),
    [
        (1, 3, 2, "rest"),
        (2, 1, 2, "rest"),
        (3, 2, 2, "fixed"),
        (4, 2, 3, "rest"),
        (5, 4, 2, "rest"),
        (6, 2, 2, "free"),
        (7, 2, 2, "closed"),
    ],
)
def test_it_has_the_same_optimum_as_the_reference_formulation(backend, seed, agents, dimension, kind):
    ocp, x = random_window(seed, steps=5, agents=agents, dimension=dimension)
    ocp = with_ends(ocp, x, kind)
    if kind == "closed":
        x = ocp.exact_ends(np.zeros_like(x) + np.concatenate([x[: 2 * agents], np.zeros(x.size - 2 * agents)]))
    chosen, required = settings(), requirements(ocp, settings().margins)
    model = build_subproblem(ocp, chosen, required, x, 0.6)
    solver = make_backend(backend)
    solver.setup(model.qp, TIGHT[backend])
    solution = solver.solve()
    assert solution.ok, solution.status
    merit = CoverageNLP(ocp, chosen).measure(x).merit(chosen.penalty)
    expected = build_reference(ocp, chosen, required, x, 0.6).solve()
    assert merit - model.predicted(solution.x) == pytest.approx(expected, rel=CLOSE[backend])


@pytest.mark.parametrize(("seed", "dimension"), [(1, 2), (2, 3), (8, 2)])
def test_with_exact_cones_it_has_the_same_optimum_as_the_reference_and_a_better_one_than_polygons(seed, dimension):
    ocp, x = random_window(seed, steps=5, agents=3, dimension=dimension)
    ocp = replace(ocp, fleet=replace(ocp.fleet, communication_range=3.9))
    required, merits = requirements(ocp, settings().margins), []
    for chosen in (replace(settings(), exact_cones=True), settings()):
        model = build_subproblem(ocp, chosen, required, x, 0.6)
        solver = make_backend("clarabel")
        solver.setup(model.qp, TIGHT["clarabel"])
        solution = solver.solve()
        assert solution.ok, solution.status
        merit = CoverageNLP(ocp, chosen).measure(x).merit(chosen.penalty)
        merits.append(merit - model.predicted(solution.x))
        assert merits[-1] == pytest.approx(build_reference(ocp, chosen, required, x, 0.6).solve(), rel=1e-4)
    assert merits[0] <= merits[1] + 1e-6


@pytest.mark.parametrize("seed", range(4))
def test_without_coverage_terms_the_iterate_is_the_optimum(seed):
    ocp, x = random_window(seed)
    idle = replace(ocp, weight=np.zeros_like(ocp.weight))
    model = build_subproblem(idle, settings(), requirements(idle, settings().margins), x, 0.6)
    solver = make_backend("piqp")
    solver.setup(model.qp, TIGHT["piqp"])
    assert model.recover(solver.solve().x) == pytest.approx(x, abs=1e-5)


@pytest.mark.parametrize("seed", range(4))
def test_a_recovered_motion_satisfies_dynamics_and_end_exactly(seed):
    ocp, x = random_window(seed)
    ocp = with_ends(ocp, x, "fixed")
    model = build_subproblem(ocp, settings(), requirements(ocp, settings().margins), x, 0.6)
    solver = make_backend("osqp")
    solver.setup(model.qp, Options(tolerance=1e-2))
    position, velocity = ocp.motion(model.recover(solver.solve().x))
    assert position[-1] == pytest.approx(ocp.ends.end_position, abs=1e-12)
    assert velocity[-1].tolist() == ocp.ends.end_velocity.tolist()


def test_the_start_of_the_model_is_feasible_for_its_rows():
    ocp, x = random_window(7)
    model = build_subproblem(ocp, settings(), requirements(ocp, settings().margins), x, 0.6)
    value = model.qp.A @ model.start
    assert (value >= model.qp.l - 1e-9).all()
    assert (value <= model.qp.u + 1e-9).all()
    assert model.predicted(model.start) == pytest.approx(0.0)


def test_an_infeasible_iterate_is_charged_and_brought_back():
    """Three agents in a row with an edge that is too long: the elastic rows shorten it."""
    ocp, _ = random_window(3)
    fleet = replace(ocp.fleet, communication_range=1.5)
    start = np.array([[1.0, 1.0], [2.2, 1.0], [3.4, 1.0]])
    ends = replace(ocp.ends, start_position=start)
    ocp = replace(ocp, fleet=fleet, ends=ends, weight=np.zeros_like(ocp.weight))
    drift = np.zeros((ocp.steps + 1, 3, 2))
    drift[1:-1, 2, 0] = 0.4
    problem = CoverageNLP(ocp, settings())
    before = problem.measure(ocp.decision(start, drift))
    model = problem.convexify(ocp.decision(start, drift), 1.0)
    solver = make_backend("piqp")
    solver.setup(model.qp, TIGHT["piqp"])
    after = problem.measure(model.recover(solver.solve().x))
    assert before.violation > 0.1
    assert after.violation < 0.1 * before.violation
