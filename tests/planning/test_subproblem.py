"""The assembled QP against the CVXPY reference, and what its answers do."""

from __future__ import annotations

import numpy as np
import pytest
from flights import fleet_of
from motions import PERIOD, grid, random_window, replace, settings

from mpc_cover.constraints.boundary import BoundaryConditions
from mpc_cover.constraints.box_overshoot import box_overshoot
from mpc_cover.constraints.control_points import has_long_steps
from mpc_cover.constraints.passive_safety import braking_encounters, stop_instants
from mpc_cover.model.look_instants import LookInstants
from mpc_cover.planning.coverage_nlp import CoverageNLP
from mpc_cover.planning.cvxpy_reference import build_cvxpy_subproblem
from mpc_cover.planning.ocp import OCP, requirements
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


def window_of(start, velocity, **changes):
    """Return a window of a fleet that flies a motion (N+1, m, d) [m/s] between walls, and its decision vector."""
    walls = {"motion_min": np.zeros(2), "motion_max": np.full(2, 8.0)}
    fleet = fleet_of(start, **{"separation_min": 0.5, "communication_range": 3.0, **walls, **changes})
    cell, ends = grid(8), BoundaryConditions(start, velocity[0], None, velocity[-1])
    weight = np.random.default_rng(len(start)).uniform(0.2, 2.0, (fleet.radius.shape[1], cell.shape[0]))
    ocp = OCP(fleet, cell, weight, len(velocity) - 1, PERIOD, ends)
    return ocp, ocp.decision(start, velocity)


def in_file(**changes):
    """Return a window of three in file that are under way, and too near for whoever is behind to stop in time."""
    behind = np.arange(3)[:, None]
    start = np.array([[5.6, 3.0]]) + behind * np.array([[-0.95, 0.12]])
    speed = np.array([1.0, 1.0, 1.0, 0.9, 0.7, 0.4, 0.0])
    velocity = speed[:, None, None] * (np.array([1.0, 0.1]) + behind * np.array([[0.06, -0.03]]))
    velocity[:, list(changes.get("lost", ()))] = 0.0
    return window_of(start, velocity, **changes)


def along_a_wall(**changes):
    """Return a window of one agent that turns before a wall, too late to brake straight on should it have to."""
    across, along = [0.9, 0.9, 0.45, 0.0, 0.0, 0.0, 0.0], [0.9, 0.9, 0.9, 0.9, 0.6, 0.3, 0.0]
    velocity = np.stack([across, along], axis=1)[:, None]
    return window_of(np.array([[7.0, 3.0]]), velocity, input_max=np.array([1.0]), **changes)


def optima(ocp, x, *, chosen=None, backend="clarabel", radius=0.6):
    """Return the optimal values of the assembled QP and of the reference; both have the same value at the iterate."""
    chosen = chosen or settings()
    required = requirements(ocp, chosen.margins)
    reference, here = (build_cvxpy_subproblem(ocp, chosen, required, x, radius) for _ in range(2))
    position, velocity = ocp.motion(x)
    here.constraints += [q == bar for q, bar in zip(here.position, position, strict=True)]
    here.constraints += [v == bar for v, bar in zip(here.velocity, velocity, strict=True)]
    model = build_subproblem(ocp, chosen, required, x, radius)
    solver = make_backend(backend)
    solver.setup(model.qp, TIGHT[backend])
    solution = solver.solve()
    assert solution.ok, solution.status
    return here.solve() - model.predicted(solution.x), reference.solve()


def with_ends(ocp, x, kind):
    """Return the window with other ends that the motion of `x` satisfies."""
    position, velocity = ocp.motion(x)
    ends = {
        "rest": ocp.ends,
        "fixed": replace(ocp.ends, end_position=position[-1], end_velocity=velocity[-1]),
        "free": BoundaryConditions(),
        "closed": BoundaryConditions(closed=True),
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
    expected = build_cvxpy_subproblem(ocp, chosen, required, x, 0.6).solve()
    assert merit - model.predicted(solution.x) == pytest.approx(expected, rel=CLOSE[backend])


@pytest.mark.parametrize("backend", ["osqp", "clarabel", "piqp"])
@pytest.mark.parametrize("reaction", [1.0, 2.0, 2.1])
def test_with_room_to_stop_it_has_the_same_optimum_as_the_reference_formulation(backend, reaction):
    ocp, x = in_file(reaction_periods=reaction)
    for moment in stop_instants(reaction):
        assert braking_encounters(*ocp.motion(x), ocp.period, ocp.fleet, moment).sample.size
    assembled, expected = optima(ocp, x, backend=backend, radius=0.1)
    assert assembled == pytest.approx(expected, rel=CLOSE[backend])
    without = replace(ocp, fleet=replace(ocp.fleet, reaction_periods=0.0))
    assert optima(without, x, radius=0.1)[0] < assembled - 0.1, "the rows bind"


@pytest.mark.parametrize("kind", ["fixed", "free"])
def test_with_room_to_stop_and_other_ends_it_has_the_same_optimum_as_the_reference_formulation(kind):
    ocp, x = in_file(reaction_periods=2.1)
    flown_on = x.reshape(-1, 3, 2)[:-1]  # it ends under way
    ocp = with_ends(replace(ocp, steps=ocp.steps - 1), flown_on.ravel(), kind)
    assembled, expected = optima(ocp, flown_on.ravel(), radius=0.1)
    assert assembled == pytest.approx(expected, rel=CLOSE["clarabel"])


@pytest.mark.parametrize("reaction", [1.0, 2.1])
def test_with_room_to_stop_before_walls_it_has_the_same_optimum_as_the_reference_formulation(reaction):
    ocp, x = along_a_wall(reaction_periods=reaction)
    assert box_overshoot(*ocp.motion(x), ocp.fleet)[:, ocp.first :].any()
    assembled, expected = optima(ocp, x, radius=0.01)
    assert assembled == pytest.approx(expected, rel=CLOSE["clarabel"])
    without = replace(ocp, fleet=replace(ocp.fleet, reaction_periods=0.0))
    assert optima(without, x, radius=0.01)[0] < assembled - 0.1, "the rows bind"


@pytest.mark.parametrize("exact_cones", [False, True])
@pytest.mark.parametrize(
    "changes",
    [
        {"lost": (1,)},
        {"lost": (0, 2)},
        {"lost": (1,), "reaction_periods": 2.1},
        {"links": ((0, 2),)},
        {"pair_separation": {(0, 1): 0.2}},
        {"input_max": np.array([1.0, 2.5, 1.5]), "speed_max": np.array([1.2, 1.4, 1.6]), "reaction_periods": 2.0},
        {"input_max": np.array([1.0, 2.5, 1.5])},
        {"radius": np.array([[1.0, -np.inf], [0.7, 1.2], [-np.inf, 0.9]])},
    ],
)
def test_for_every_kind_of_fleet_it_has_the_same_optimum_as_the_reference_formulation(changes, exact_cones):
    longest = 2.0 if "links" in changes else 1.02  # as long as edges get, about
    ocp, x = in_file(**{"communication_range": longest, **changes})
    chosen = replace(settings(), exact_cones=exact_cones)
    assembled, expected = optima(ocp, x, chosen=chosen)
    assert assembled == pytest.approx(expected, rel=1e-4 if exact_cones else 1e-5)


@pytest.mark.parametrize("kind", ["rest", "fixed", "free"])
def test_with_looks_owed_it_has_the_same_optimum_as_the_reference_formulation(kind):
    ocp, x = random_window(3, steps=5, agents=2)
    ocp = replace(with_ends(ocp, x, kind), looks=1 + np.arange(ocp.weight.size).reshape(ocp.weight.shape) % 3)
    assembled, expected = optima(ocp, x)
    assert assembled == pytest.approx(expected, rel=CLOSE["clarabel"])


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
        assert merits[-1] == pytest.approx(build_cvxpy_subproblem(ocp, chosen, required, x, 0.6).solve(), rel=1e-4)
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


@pytest.mark.parametrize("instants", [LookInstants(continuous=True), LookInstants(per_step=3)])
@pytest.mark.parametrize(
    ("seed", "agents", "dimension", "kind"), [(1, 3, 2, "rest"), (4, 2, 3, "rest"), (6, 2, 2, "free")]
)
def test_with_looks_between_samples_it_has_the_same_optimum_as_the_reference(instants, seed, agents, dimension, kind):
    ocp, x = random_window(seed, steps=5, agents=agents, dimension=dimension)
    ocp = with_ends(replace(ocp, fleet=replace(ocp.fleet, look_instants=instants)), x, kind)
    assembled, expected = optima(ocp, x)
    assert assembled == pytest.approx(expected, rel=CLOSE["clarabel"])
    merit = CoverageNLP(ocp, settings()).measure(x).objective
    model = build_subproblem(ocp, settings(), requirements(ocp, settings().margins), x, 0.6)
    assert model.predicted(model.start) == pytest.approx(0.0, abs=1e-9)
    assert (
        merit
        <= CoverageNLP(replace(ocp, fleet=replace(ocp.fleet, look_instants=LookInstants())), settings())
        .measure(x)
        .objective
        + 1e-9
    ), "more looks measure no less"


@pytest.mark.parametrize("instants", [LookInstants(continuous=True), LookInstants()])
def test_with_long_steps_it_has_the_same_optimum_as_the_reference_formulation(instants):
    ocp, x = in_file(look_instants=instants, radius=np.full((3, 1), 0.3))
    assert has_long_steps(ocp.fleet, ocp.period)
    assembled, expected = optima(ocp, x)
    assert assembled == pytest.approx(expected, rel=CLOSE["clarabel"])
