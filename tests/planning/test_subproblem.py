"""The assembled QP against the CVXPY reference, and what its answers do."""

from __future__ import annotations

import numpy as np
import pytest
from motions import random_window, replace, settings

from mpc_cover.planning.problem import CoverageProblem
from mpc_cover.planning.reference import build_reference
from mpc_cover.planning.subproblem import build_subproblem
from mpc_cover.planning.window import requirements
from solvers.backends.base import Options
from solvers.backends.registry import make_backend

TIGHT = {
    "osqp": Options(tolerance=1e-7, max_iterations=100_000),
    "clarabel": Options(tolerance=1e-9),
    "piqp": Options(tolerance=1e-9),
}


def fixed_end(window, x):
    position, velocity = window.motion(x)
    return replace(window, end_position=position[-1], end_velocity=velocity[-1])


@pytest.mark.parametrize("backend", ["osqp", "clarabel", "piqp"])
@pytest.mark.parametrize(
    ("seed", "agents", "dimension", "fixed"),
    [(1, 3, 2, False), (2, 1, 2, False), (3, 2, 2, True), (4, 2, 3, False), (5, 4, 2, False)],
)
def test_it_has_the_same_optimum_as_the_reference_formulation(backend, seed, agents, dimension, fixed):
    window, x = random_window(seed, steps=5, agents=agents, dimension=dimension)
    if fixed:
        window = fixed_end(window, x)
    chosen, required = settings(), requirements(window, settings().margins)
    model = build_subproblem(window, chosen, required, x, 0.6)
    solver = make_backend(backend)
    solver.setup(model.qp, TIGHT[backend])
    solution = solver.solve()
    assert solution.ok, solution.status
    merit = CoverageProblem(window, chosen).measure(x).merit(chosen.penalty)
    expected = build_reference(window, chosen, required, x, 0.6).solve()
    assert merit - model.predicted(solution.x) == pytest.approx(expected, rel=1e-5, abs=1e-5)


@pytest.mark.parametrize("seed", range(4))
def test_without_coverage_terms_the_iterate_is_the_optimum(seed):
    window, x = random_window(seed)
    idle = replace(window, weight=np.zeros_like(window.weight))
    model = build_subproblem(idle, settings(), requirements(idle, settings().margins), x, 0.6)
    solver = make_backend("piqp")
    solver.setup(model.qp, TIGHT["piqp"])
    assert model.recover(solver.solve().x) == pytest.approx(x, abs=1e-5)


@pytest.mark.parametrize("seed", range(4))
def test_a_recovered_motion_satisfies_dynamics_and_end_exactly(seed):
    window, x = random_window(seed)
    window = fixed_end(window, x)
    model = build_subproblem(window, settings(), requirements(window, settings().margins), x, 0.6)
    solver = make_backend("osqp")
    solver.setup(model.qp, Options(tolerance=1e-2))
    position, velocity = window.motion(model.recover(solver.solve().x))
    assert position[-1] == pytest.approx(window.end_position, abs=1e-12)
    assert velocity[-1].tolist() == window.end_velocity.tolist()


def test_the_start_of_the_model_is_feasible_for_its_rows():
    window, x = random_window(7)
    model = build_subproblem(window, settings(), requirements(window, settings().margins), x, 0.6)
    value = model.qp.A @ model.start
    assert (value >= model.qp.l - 1e-9).all()
    assert (value <= model.qp.u + 1e-9).all()
    assert model.predicted(model.start) == pytest.approx(0.0)


def test_an_infeasible_iterate_is_charged_and_brought_back():
    """Three agents in a row with an edge that is too long: the elastic rows shorten it."""
    window, _ = random_window(3)
    fleet = replace(window.fleet, communication_range=1.5)
    start = np.array([[1.0, 1.0], [2.2, 1.0], [3.4, 1.0]])
    window = replace(window, fleet=fleet, position=start, weight=np.zeros_like(window.weight))
    drift = np.zeros((window.steps, 3, 2))
    drift[:-1, 2, 0] = 0.4
    problem = CoverageProblem(window, settings())
    before = problem.measure(drift.ravel())
    model = problem.convexify(drift.ravel(), 1.0)
    solver = make_backend("piqp")
    solver.setup(model.qp, TIGHT["piqp"])
    after = problem.measure(model.recover(solver.solve().x))
    assert before.violation > 0.1
    assert after.violation < 0.1 * before.violation
