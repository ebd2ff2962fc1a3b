"""The smallest distance along the continuous path against truths on paper and dense sampling."""

from __future__ import annotations

import numpy as np
import pytest
from flights import fleet_of, propagate
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from mpc_cover.verification.motion import verify_motion
from mpc_cover.verification.path import Path
from mpc_cover.verification.separation import (
    are_far_apart,
    closest_approach,
    smallest_separation,
    smallest_separations,
)

PART = np.linspace(0.0, 1.0, 2001)[:, None, None]


def coefficients(scale: float = 10.0):
    """Vectors whose entries are of very different sizes, and often zero."""
    element = st.one_of(
        st.just(0.0),
        st.floats(-scale, scale),
        st.floats(-1e-9, 1e-9),
        st.sampled_from([1.0, -1.0, 2.0, -2.0, 0.5]),
    )
    return arrays(float, (4, 2), elements=element)


def along(a, b, c, part):
    return np.linalg.norm(a + b * part + c * part**2, axis=-1)


@given(coefficients(), coefficients(), coefficients())
def test_exact_minimum_is_never_above_dense_sampling_and_is_attained(a, b, c):
    part, distance = closest_approach(a, b, c)
    dense = along(a, b, c, PART).min(axis=0)
    size = 1.0 + np.abs(a).max() + np.abs(b).max() + np.abs(c).max()
    assert (distance <= dense + 1e-12 * size).all()
    assert ((part >= 0.0) & (part <= 1.0)).all()
    attained = np.linalg.norm(a + b * part[:, None] + c * part[:, None] ** 2, axis=1)
    np.testing.assert_allclose(attained, distance, atol=1e-12 * size)


@given(coefficients(), coefficients(), coefficients(), st.floats(0.0, 1.0))
def test_a_collision_anywhere_within_the_interval_is_found(a, b, c, when):
    hit = -(b * when + c * when**2)
    _, distance = closest_approach(hit, b, c)
    del a
    np.testing.assert_allclose(distance, 0.0, atol=1e-6 * (1.0 + np.abs(b).max() + np.abs(c).max()))


@pytest.mark.parametrize("tiny", [0.0, 1e-300, 1e-160, 1e-30, 1e-12, 1e-8])
def test_vanishing_curvature_does_not_lead_astray(tiny):
    a, b = np.array([[-1.0, 0.25]]), np.array([[2.0, 0.0]])
    part, distance = closest_approach(a, b, np.array([[tiny, -tiny]]))
    assert part[0] == pytest.approx(0.5, abs=1e-6)
    assert distance[0] == pytest.approx(0.25, abs=1e-7)


def test_of_two_minima_the_lower_one_is_found():
    # x runs to and fro past the other agent, y leans to one side
    a, b, c = np.array([[-0.9, 1.0]]), np.array([[4.0, -0.4]]), np.array([[-4.0, 0.0]])
    part, distance = closest_approach(a, b, c)
    dense = along(a, b, c, PART)[:, 0]
    assert distance[0] <= dense.min() + 1e-12
    assert part[0] == pytest.approx(PART[np.argmin(dense), 0, 0], abs=1e-3)


def test_two_at_rest_keep_their_distance():
    zero = np.zeros((1, 2))
    _, distance = closest_approach(np.array([[3.0, 4.0]]), zero, zero)
    assert distance[0] == 5.0


def crossing(offset: float) -> Path:
    """Two agents that pass each other at `offset` [m] half way between two samples."""
    time = np.array([0.0, 1.0, 2.0])
    start = np.array([[0.0, 0.0], [3.0, offset]])
    speed = np.array([[1.0, 0.0], [-1.0, 0.0]])
    force = np.zeros((2, 2, 2))
    position, velocity = propagate(start, force, time, speed)
    return Path(time, position, velocity, force)


def test_head_on_agents_meet_between_the_samples():
    closest = smallest_separation(crossing(0.0))
    assert closest is not None
    assert closest.value == pytest.approx(0.0, abs=1e-9)
    assert closest.time == pytest.approx(1.5)
    assert closest.pair == (0, 1)


def test_known_closest_approach_of_a_crossing():
    closest = smallest_separation(crossing(0.3))
    assert closest is not None
    assert closest.value == pytest.approx(0.3, abs=1e-12)


def test_braking_agent_comes_closest_where_it_turns():
    # towards the other at 1 m/s, pushed back at 2 m/s^2: turns after 0.5 s and 0.25 m
    time, force = np.array([0.0, 1.0]), np.array([[[-2.0, 0.0], [0.0, 0.0]]])
    start, speed = np.array([[0.0, 0.0], [0.75, 0.0]]), np.array([[1.0, 0.0], [0.0, 0.0]])
    position, velocity = propagate(start, force, time, speed)
    closest = smallest_separation(Path(time, position, velocity, force))
    assert closest is not None
    assert closest.value == pytest.approx(0.5, abs=1e-12)
    assert closest.time == pytest.approx(0.5)


def test_one_agent_has_no_separation():
    zero = np.zeros((2, 1, 2))
    assert smallest_separation(Path(np.array([0.0, 1.0]), zero, zero, zero[:1])) is None


def test_the_verifier_finds_what_the_samples_do_not_show():
    path = crossing(0.45)
    fleet = fleet_of(path.position[0], separation_min=0.5)
    gap = np.linalg.norm(path.position[:, 0] - path.position[:, 1], axis=1)
    assert gap.min() > 1.0
    report = verify_motion(fleet, path.time, path.position, path.velocity, path.force)
    assert report.first_failure is not None
    assert report.first_failure.name == "separation"
    assert report.first_failure.margin == pytest.approx(-0.05)
    assert report.first_failure.where == "a1 - a2, t = 1.500 s"


@st.composite
def flights(draw):
    """Random motions of up to five agents on an uneven grid, tiny intervals among it."""
    agents = draw(st.integers(2, 5))
    dimension = draw(st.integers(2, 3))
    steps = draw(st.lists(st.sampled_from([1e-4, 0.1, 0.37, 0.5]), min_size=1, max_size=5))
    time = np.concatenate([[0.0], np.cumsum(steps)])
    box = st.floats(-3.0, 3.0)
    start = draw(arrays(float, (agents, dimension), elements=box))
    speed = draw(arrays(float, (agents, dimension), elements=st.floats(-1.5, 1.5)))
    force = draw(arrays(float, (len(steps), agents, dimension), elements=st.floats(-2.0, 2.0)))
    position, velocity = propagate(start, force, time, speed)
    return Path(time, position, velocity, force)


@given(flights())
def test_smallest_separation_of_random_flights_against_dense_sampling(path):
    closest = smallest_separation(path)
    assert closest is not None
    _, dense = path.dense(200)
    first, second = path.pair
    sampled = np.linalg.norm(dense[:, first] - dense[:, second], axis=2).min()
    assert closest.value <= sampled + 1e-9
    # between two of the dense samples nobody gets farther than relative speed times half their gap
    assert closest.value >= sampled - 0.5 / 400 * 12.0


def of_two(path, i, j):
    """Return the smallest distance [m] of two agents, on a path of them alone."""
    pair = [i, j]
    closest = smallest_separation(Path(path.time, path.position[:, pair], path.velocity[:, pair], path.force[:, pair]))
    assert closest is not None
    return closest.value


@given(flights())
def test_smallest_separations_are_those_of_each_pair_on_its_own(path):
    found = smallest_separations(path)
    alone = [of_two(path, i, j) for i, j in zip(*path.pair, strict=True)]
    np.testing.assert_allclose(found, alone, rtol=0.0, atol=1e-12)
    assert found.min() == pytest.approx(smallest_separation(path).value, abs=1e-12)


@given(flights(), st.data())
def test_smallest_separations_of_some_pairs_in_either_order(path, data):
    agents = st.integers(0, path.position.shape[1] - 1)
    chosen = data.draw(st.lists(st.tuples(agents, agents).filter(lambda pair: pair[0] != pair[1]), max_size=4))
    first, second = np.array(chosen, dtype=int).reshape(-1, 2).T
    found = smallest_separations(path, (first, second))
    np.testing.assert_allclose(found, [of_two(path, i, j) for i, j in chosen], rtol=0.0, atol=1e-12)


def test_smallest_separations_along_a_path_that_is_worked_on_piece_by_piece():
    rng, time = np.random.default_rng(0), 0.1 * np.arange(401)
    start, force = rng.uniform(-20.0, 20.0, (30, 2)), rng.uniform(-1.0, 1.0, (400, 30, 2))
    path = Path(time, *propagate(start, force, time), force)
    assert len(list(path.pieces())) > 1
    found, (first, second) = smallest_separations(path), path.pair
    some = rng.integers(first.size, size=20)
    np.testing.assert_allclose(found[some], [of_two(path, first[k], second[k]) for k in some], rtol=0.0, atol=1e-12)
    assert found.min() == pytest.approx(smallest_separation(path).value, abs=1e-12)


def test_nobody_is_near_a_lone_agent():
    zero = np.zeros((2, 1, 2))
    assert smallest_separations(Path(np.array([0.0, 1.0]), zero, zero, zero[:1])).size == 0


@given(flights(), st.floats(0.0, 3.0))
def test_who_is_far_apart_by_bounds_is_so(path, asked):
    least = smallest_separations(path)
    if are_far_apart(path, path.pair, np.full(least.size, asked)):
        assert (least >= asked - 1e-9).all()
    assert not are_far_apart(path, path.pair, least + 1e-6)
