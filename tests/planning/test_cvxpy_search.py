"""Plans by subproblems in CVXPY: a user's terms and constraints are kept, wherever the mission lies."""

import re

import cvxpy as cp
import numpy as np
import pytest
from tiny_mission import TINY

import mpc_cover
from mpc_cover.planning.cvxpy_problem import SOLVER_OPTIONS
from mpc_cover.planning.offline import PlanOptions
from mpc_cover.studies.mission_transforms import moved, scaled

SHORT = {**TINY, "name": "short", "planning": {"duration_s": 4.0}}
SHORTEST = {**SHORT, "planning": {"duration_s": 3.0}}
CORNER = 4.0


def corner(motion, mission):
    """The north-east corner is closed."""
    return [], {"corner": motion.position[:, :, 0] + motion.position[:, :, 1] <= CORNER}


def planned(extra=None, raw=SHORT, **options):
    return mpc_cover.plan(raw, formulation="cvxpy", starts=options.pop("starts", 2), extra=extra, **options)


@pytest.fixture(scope="module")
def free():
    return planned()


def test_without_an_extra_it_is_the_same_problem_and_the_same_every_time(free):
    assembled = mpc_cover.plan(SHORT, starts=2)
    assert free.meta["cost_m"] <= assembled.meta["cost_m"] + 0.1
    assert (free.meta["formulation"], free.meta["backend"]) == ("cvxpy", "clarabel")
    assert set(free.meta["cvxpy"]["statuses"]) == {"optimal"}
    assert free.meta["subproblems"] == sum(free.meta["cvxpy"]["statuses"].values()) > 0
    np.testing.assert_array_equal(planned().position, free.position)


def test_a_constraint_holds_that_would_not_by_itself(free):
    assert free.position.sum(axis=2).max() > CORNER + 0.05
    plan = planned(corner)
    assert plan.position.sum(axis=2).max() <= CORNER + 1e-5
    assert mpc_cover.check(plan, extra=corner).holds
    assert not mpc_cover.check(free, extra=corner).holds
    assert plan.meta["extra"] == f"{__name__}:corner"


def test_a_term_is_weighed_against_what_is_covered(free):
    def effort(motion, mission):
        return [0.2 * cp.sum_squares(motion.input)], []

    plan = planned(effort)
    worth = (plan.input**2).sum()
    assert worth < 0.8 * (free.input**2).sum()
    assert plan.meta["extra_value"] == pytest.approx(0.2 * worth)
    assert plan.meta["cost_m"] + 0.2 * worth < free.meta["cost_m"] + 0.2 * (free.input**2).sum()


def test_a_keep_out_disc_linearised_at_the_iterate_is_flown_around():
    centre, radius = np.array([1.5, 1.5]), 0.5

    def keep_out(motion, mission):
        away = motion.iterate.position - centre
        away /= np.maximum(np.linalg.norm(away, axis=2, keepdims=True), 1e-9)
        return [], [cp.sum(cp.multiply(away, motion.position - centre), axis=2) >= radius]

    plan = planned(keep_out)
    assert np.linalg.norm(plan.position - centre, axis=2).min() >= radius - 1e-5
    assert mpc_cover.check(plan).holds


def test_positions_velocities_and_inputs_are_the_plans_own():
    seen = []

    def meet(motion, mission):
        seen.append((motion.position.shape, motion.velocity.shape, motion.input.shape, motion.time.size))
        slow = cp.norm(motion.velocity[4, 0], 1) <= 0.1
        return [], {
            "there": motion.position[4, 0] == [1.0, 1.2],
            "slow": slow,
            "held": motion.input[5, 1] == [0.0, 0.0],
        }

    plan = planned(meet)
    np.testing.assert_allclose(plan.position[4, 0], [1.0, 1.2], atol=1e-5)
    assert np.abs(plan.velocity[4, 0]).sum() <= 0.1 + 1e-5
    np.testing.assert_allclose(plan.input[5, 1], 0.0, atol=1e-5)
    assert set(seen) == {((9, 2, 2), (9, 2, 2), (8, 2, 2), 9)}


def test_of_long_steps_it_is_given_the_samples_between():
    raw = {**SHORT, "control": {"period_s": 0.25, "plan_step_s": 0.5}}
    shapes = []

    def wall(motion, mission):
        shapes.append(motion.position.shape)
        return [], [motion.position[:, :, 1] <= 1.6]

    plan = planned(wall, raw)
    assert set(shapes) == {(17, 2, 2)} == {plan.position.shape}
    assert plan.position[:, :, 1].max() <= 1.6 + 1e-5


@pytest.fixture(scope="module")
def as_it_is():
    return planned(corner, SHORTEST, starts=1)


@pytest.mark.parametrize(("factor", "shift"), [(1e-2, 0.0), (1.0, 5e5), (1e2, 0.0)])
def test_it_is_written_in_the_missions_own_metres(as_it_is, factor, shift):
    def scaled_corner(motion, mission):
        sums = motion.position[:, :, 0] + motion.position[:, :, 1]
        return [], [sums <= factor * CORNER + 2.0 * shift]

    plan = planned(scaled_corner, moved(scaled(SHORTEST, factor), [shift, shift]), starts=1)
    assert (plan.position - shift).sum(axis=2).max() <= factor * CORNER + 1e-5 * factor + 1e-8
    assert plan.meta["cost_m"] / factor == pytest.approx(as_it_is.meta["cost_m"], rel=0.02)


def test_a_plan_as_long_as_it_takes_covers_what_it_may():
    plan = planned(lambda motion, _: ([], [motion.position[:, :, 1] <= 2.6]), TINY)
    assert plan.meta["cost_m"] == 0.0
    assert np.isfinite(plan.covered_at).all()


def test_whatever_the_time_limit_the_result_holds():
    plan = planned(raw=mpc_cover.load_mission("box-3"), time_limit_s=1e-3)
    assert mpc_cover.check(plan).holds


def test_what_leaves_no_motion_is_told_with_the_status_and_the_constraint():
    def wishes(motion, mission):
        y = motion.position[:, :, 1]
        return [], {"low": y <= 2.5, "far": motion.position[1, 0] == [2.9, 2.9], "slow": cp.abs(motion.velocity) <= 0.5}

    with pytest.raises(mpc_cover.UserError) as raised:
        planned(wishes)
    message = str(raised.value)
    assert "its constraints leave no motion of 4 s within limits, box and ends" in message
    assert "CVXPY's status is infeasible with them (CLARABEL, from 2 guesses), optimal without" in message
    assert message.endswith("infeasible: far alone")


def test_constraints_that_only_together_leave_none():
    def wishes(motion, mission):
        x = motion.position[-1, 0, 0]
        return [], [x <= 1.0, x >= 2.0]

    with pytest.raises(mpc_cover.UserError, match="infeasible: only all of them together"):
        planned(wishes)


def test_terms_without_a_lower_bound():
    with pytest.raises(mpc_cover.UserError, match="no lower bound: CVXPY's status is unbounded"):
        planned(lambda motion, _: ([cp.Variable() + cp.sum_squares(motion.input)], []))


@pytest.mark.parametrize("backend", ["piqp", "scs", "osqp"])
def test_any_solver_that_takes_the_problem_solves_it(as_it_is, backend):
    plan = planned(corner, SHORTEST, backend=backend, starts=1)
    assert mpc_cover.check(plan, extra=corner).holds
    assert plan.meta["cvxpy"]["solver"] == backend.upper()
    assert plan.meta["cost_m"] == pytest.approx(as_it_is.meta["cost_m"], rel=0.05)


def test_statuses_of_subproblems_that_were_not_solved_are_kept(monkeypatch):
    monkeypatch.setitem(SOLVER_OPTIONS, "CLARABEL", {"max_iter": 3})
    plan = planned(corner, SHORTEST, starts=1)
    assert plan.meta["cvxpy"]["status"] == "user_limit"
    assert set(plan.meta["cvxpy"]["statuses"]) == {"user_limit"}
    assert mpc_cover.check(plan).holds


def test_a_qp_solver_takes_no_norms():
    with pytest.raises(mpc_cover.UserError, match=r"--backend piqp: .* use clarabel or scs"):
        planned(lambda motion, _: ([cp.norm(motion.input[0, 0])], []), backend="piqp")


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (
            {"formulation": "cvxpy", "backend": "gurobi"},
            "gurobi: is none of CVXPY's here: must be one of clarabel",
        ),
        ({"formulation": "cvxpy", "backend": "osqp", "exact_cones": True}, "osqp: has no second-order cones"),
        ({"formulation": "cvxpy", "min_time": True}, "formulation cvxpy: searches for no shortest plan"),
        ({"formulation": "lp"}, "formulation lp: must be qp or cvxpy"),
    ],
)
def test_options_that_do_not_go_together(options, words):
    with pytest.raises(mpc_cover.UserError, match=re.escape(words)):
        PlanOptions(**{"backend": "clarabel", **options})


def test_an_extra_is_part_of_cvxpys_subproblem():
    with pytest.raises(mpc_cover.UserError, match="needs formulation cvxpy"):
        mpc_cover.plan(SHORT, extra=corner)
