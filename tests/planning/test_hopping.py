"""Leaving local minima: never worse, always feasible, reproducible, and able to do what a descent is not."""

import time

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as examples
from hypothesis import strategies as st
from motions import random_window

from mpc_cover.mission.load import load_mission
from mpc_cover.planning.continuation import judge, refine
from mpc_cover.planning.guesses import rest_guess
from mpc_cover.planning.hopping import hopped, kicked, refine_thoroughly, shaken
from mpc_cover.planning.offline import offline_task
from mpc_cover.verification.motion import verify_motion
from solvers.backends.registry import make_backend


@examples(deadline=None, max_examples=20)
@given(st.integers(0, 10_000), st.floats(0.0, 3.0))
def test_a_shake_keeps_the_ends_that_are_given(seed, amplitude):
    window, x = random_window(seed % 50)
    moved = shaken(window, x, amplitude, np.random.default_rng(seed))
    (before, speeds), (after, new) = window.motion(x), window.motion(moved)
    np.testing.assert_array_equal(after[0], before[0])
    np.testing.assert_array_equal(new[0], speeds[0])
    if window.ends.end_velocity is not None:
        np.testing.assert_array_equal(new[-1], window.ends.end_velocity)


def test_a_shake_of_no_amplitude_moves_nothing():
    window, x = random_window(3)
    still = shaken(window, window.exact_ends(x), 0.0, np.random.default_rng(0))
    np.testing.assert_allclose(still, window.exact_ends(x), atol=1e-12)


@pytest.mark.parametrize("seed", range(3))
def test_hops_are_never_worse_feasible_and_reproducible(seed):
    window, x = random_window(seed, steps=8)
    backend = make_backend("piqp")
    best = refine(window, x, backend)
    heard = []
    runs = [
        hopped(window, best, backend, rounds=3, guesses=[x], seed=seed, told=lambda found: heard.append(found.cost))
        for _ in range(2)
    ]
    np.testing.assert_array_equal(runs[0].x, runs[1].x)
    assert runs[0].cost <= best.cost
    assert runs[0].cost == judge(window, runs[0].x).cost
    assert heard[: len(heard) // 2] == sorted(heard[: len(heard) // 2], reverse=True)
    position, velocity = window.motion(runs[0].x)
    force = np.diff(velocity, axis=0) / window.period
    at = window.period * np.arange(window.steps + 1)
    assert verify_motion(window.fleet, at, position, velocity, force, at_rest=True).holds


def test_no_rounds_and_no_time_return_what_was_there():
    window, x = random_window(1)
    backend, best = make_backend("piqp"), judge(window, x)
    assert hopped(window, best, backend, rounds=0).x.tolist() == x.tolist()
    assert hopped(window, best, backend, rounds=None, deadline=time.perf_counter() - 1.0).x.tolist() == x.tolist()
    assert kicked(window, best, backend, deadline=time.perf_counter() - 1.0).cost <= best.cost


def test_from_rest_hops_cover_what_a_descent_leaves():
    """One agent of the thesis's Figure 3.3 from the guess at rest: the descent gets stuck."""
    task = offline_task(load_mission("configs/thesis/fig-3-3.yaml"))
    window = task.window(30)
    x = window.exact_ends(task.flown(rest_guess(task.position), 30).decision)
    backend = make_backend("piqp")
    descent = refine(window, x, backend)
    found = refine_thoroughly(window, x, backend, rounds=4, seed=0)
    assert descent.cost > 0.0
    assert found.feasible
    assert found.cost < 0.9 * descent.cost
