"""Leaving local minima: never worse, always feasible, reproducible, and able to do what a descent is not."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as examples
from hypothesis import strategies as st
from motions import EXHAUSTED, UNLIMITED, random_window

from mpc_cover.mission.load import load_mission
from mpc_cover.planning.basin_hopping import basin_hopping, perturbed, reweighted
from mpc_cover.planning.initial_guess.guess import rest_guess
from mpc_cover.planning.multistart import Search, multistart
from mpc_cover.planning.offline import offline_task
from mpc_cover.planning.scp import evaluate, optimise
from mpc_cover.verification.motion import verify_motion
from solvers.backends.registry import make_backend


@examples(deadline=None, max_examples=20)
@given(st.integers(0, 10_000), st.floats(0.0, 3.0))
def test_a_shake_keeps_the_ends_that_are_given(seed, amplitude):
    ocp, x = random_window(seed % 50)
    moved = perturbed(ocp, x, amplitude, np.random.default_rng(seed))
    (before, speeds), (after, new) = ocp.motion(x), ocp.motion(moved)
    np.testing.assert_array_equal(after[0], before[0])
    np.testing.assert_array_equal(new[0], speeds[0])
    if ocp.ends.end_velocity is not None:
        np.testing.assert_array_equal(new[-1], ocp.ends.end_velocity)


def test_a_shake_of_no_amplitude_moves_nothing():
    ocp, x = random_window(3)
    still = perturbed(ocp, ocp.exact_ends(x), 0.0, np.random.default_rng(0))
    np.testing.assert_allclose(still, ocp.exact_ends(x), atol=1e-12)


@pytest.mark.parametrize("seed", range(3))
def test_hops_are_never_worse_feasible_and_reproducible(seed):
    ocp, x = random_window(seed, steps=8)
    backend = make_backend("piqp")
    best = optimise(ocp, x, backend, budget=UNLIMITED)
    heard, bounds = [], {"rounds": 3, "budget": UNLIMITED}
    runs = [
        basin_hopping(
            ocp, best, backend, **bounds, guesses=[x], seed=seed, on_progress=lambda found: heard.append(found.cost)
        )
        for _ in range(2)
    ]
    np.testing.assert_array_equal(runs[0].x, runs[1].x)
    assert runs[0].cost <= best.cost
    assert runs[0].cost == evaluate(ocp, runs[0].x).cost
    assert heard[: len(heard) // 2] == sorted(heard[: len(heard) // 2], reverse=True)
    position, velocity = ocp.motion(runs[0].x)
    force = np.diff(velocity, axis=0) / ocp.period
    at = ocp.period * np.arange(ocp.steps + 1)
    assert verify_motion(ocp.fleet, at, position, velocity, force, at_rest=True).holds


def test_no_rounds_and_no_time_return_what_was_there():
    ocp, x = random_window(1)
    backend, best = make_backend("piqp"), evaluate(ocp, x)
    assert basin_hopping(ocp, best, backend, rounds=0, budget=UNLIMITED).x.tolist() == x.tolist()
    assert basin_hopping(ocp, best, backend, rounds=None, budget=EXHAUSTED).x.tolist() == x.tolist()
    assert reweighted(ocp, best, backend, budget=EXHAUSTED).cost <= best.cost


def test_from_rest_hops_cover_what_a_descent_leaves():
    """One agent of the thesis's Figure 3.3 from the guess at rest: the descent gets stuck."""
    task = offline_task(load_mission("configs/thesis/fig-3-3.yaml"))
    ocp = task.ocp(30)
    x = ocp.decision_of(task.flown(rest_guess(task.position), 30))
    backend = make_backend("native")
    descent = optimise(ocp, x, backend, budget=UNLIMITED)
    found = multistart(task, backend, 30, Search(rounds=4), UNLIMITED, given={"still": x})[0]
    assert found.origin.name == "still"
    assert descent.cost > 0.0
    assert found.feasible
    assert found.cost < 0.9 * descent.cost
