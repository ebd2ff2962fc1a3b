"""Single integrators: no wish brings a sampled fleet into collision or apart, at any instant."""

from __future__ import annotations

import numpy as np
import pytest
from crowds import RANGE, SEPARATION, WISHES, crowd, pair_lengths
from hypothesis import given, settings
from hypothesis import strategies as st

from mpc_cover.distributed.potential_functions import Coordination, CoverageShape
from mpc_cover.distributed.potential_law import Bounds, LawParameters, PotentialLaw
from mpc_cover.distributed.single_integrator_filter import fan
from mpc_cover.information.delay import adjacency
from mpc_cover.verification.connectivity import widest_bottleneck
from mpc_cover.verification.path import Path
from mpc_cover.verification.separation import smallest_separation

PERIOD = 0.5


def law(agents, dimension=2, edges="both", separation=SEPARATION, reach=RANGE, speed=1.0, box=50.0):
    bounds = Bounds(np.full(agents, speed), None, np.full(dimension, -box), np.full(dimension, box))
    coordination = Coordination(separation, 1.0, reach, 0.7 * reach) if separation else Coordination()
    parameters = LawParameters(CoverageShape(), edges=edges)
    return PotentialLaw(np.zeros((1, dimension)), bounds, coordination, parameters, PERIOD)


def path_of(position):
    """Return the straight pieces between samples, as the verifier takes them."""
    position = np.array(position)
    velocity = np.diff(position, axis=0, append=position[-1:]) / PERIOD
    time = PERIOD * np.arange(len(position))
    return Path(time, position, velocity, np.zeros_like(position[:-1]))


def fly(rng, law, position, wish, steps):
    path = [position]
    for n in range(steps):
        wished = wish(rng, path[-1], n)
        wished = wished / np.maximum(np.linalg.norm(wished, axis=1), 1.0)[:, None]
        path.append(law.step(path[-1], wished, law.kept_edges(path[-1])))
    return np.array(path)


@pytest.mark.parametrize("kind", WISHES)
def test_apart_and_connected_at_every_instant(kind):
    rng = np.random.default_rng(len(kind))
    for agents, dimension, edges in ((9, 2, "both"), (6, 3, "either"), (14, 2, "own")):
        filtered = law(agents, dimension, edges)
        flown = fly(rng, filtered, crowd(rng, agents, dimension), WISHES[kind], 150)
        path = path_of(flown)
        assert smallest_separation(path).value >= SEPARATION
        assert widest_bottleneck(path, limit=RANGE, resolution=1e-10).value <= RANGE + 1e-9
        assert (np.linalg.norm(np.diff(flown, axis=0), axis=2) <= PERIOD * (1.0 + 1e-12)).all()


def test_without_the_filter_the_same_wishes_do_harm():
    rng = np.random.default_rng(0)
    position = crowd(rng, 9)
    swapped = position + PERIOD * WISHES["swap"](rng, position, 0)
    assert smallest_separation(path_of([position, swapped])).value < SEPARATION


@settings(max_examples=60)
@given(seed=st.integers(0, 10**6), dimension=st.sampled_from([2, 3]))
def test_an_agent_needs_those_only_that_it_hears(seed, dimension):
    """Its own neighbourhood, as a fleet of its own, gives it the same step; its own choice of edges."""
    rng = np.random.default_rng(seed)
    position = crowd(rng, 9, dimension)
    wish = rng.normal(size=position.shape)
    wish /= np.maximum(np.linalg.norm(wish, axis=1), 1.0)[:, None]
    whole = law(9, dimension, "own")
    after = whole.step(position, wish, whole.kept_edges(position))
    heard = adjacency(position, RANGE) | np.eye(9, dtype=bool)
    for agent in range(9):
        near = np.flatnonzero(heard[agent])
        me = int(np.flatnonzero(near == agent)[0])
        part = law(len(near), dimension, "own")
        alone = part.step(position[near], wish[near], part.kept_edges(position[near]))
        np.testing.assert_allclose(alone[me], after[agent], atol=1e-12)


def test_a_wish_that_harms_nobody_is_granted():
    position = np.array([[0.0, 0.0], [2.0, 0.0], [1.0, 2.0]])
    wish = np.array([[0.3, 0.7], [-0.2, 0.1], [0.0, -0.5]])
    filtered = law(3)
    after = filtered.step(position, wish, filtered.kept_edges(position))
    np.testing.assert_allclose(after, position + PERIOD * wish, atol=1e-9)


def test_those_who_touch_may_part_and_slide():
    position = np.array([[0.0, 0.0], [SEPARATION, 0.0]])
    filtered = law(2)
    kept = filtered.kept_edges(position)
    parted = filtered.step(position, np.array([[-1.0, 0.0], [1.0, 0.0]]), kept)
    assert pair_lengths(parted)[0] == pytest.approx(SEPARATION + 2.0 * PERIOD)
    slid = filtered.step(position, np.array([[0.5, 0.8], [0.0, 0.0]]), kept)
    assert slid[0, 1] > 0.3


def test_the_slack_is_split_in_half():
    filtered = law(2)
    head_on = np.array([[0.0, 0.0], [0.9, 0.0]])
    met = filtered.step(head_on, np.array([[1.0, 0.0], [-1.0, 0.0]]), filtered.kept_edges(head_on))
    np.testing.assert_allclose(met[:, 0], [0.2, 0.7], atol=1e-8)
    stretched = np.array([[0.0, 0.0], [RANGE - 0.3, 0.0]])
    parted = filtered.step(stretched, np.array([[-1.0, 0.0], [1.0, 0.0]]), filtered.kept_edges(stretched))
    np.testing.assert_allclose(parted[:, 0], [-0.15, RANGE - 0.15], atol=1e-8)


def test_what_is_violated_never_gets_worse():
    rng = np.random.default_rng(4)
    position = np.array([[0.0, 0.0], [0.0, 0.0], [0.2, 0.0], [0.3, 0.1]])
    flown = fly(rng, law(4), position, WISHES["crush"], 60)
    closest = np.array([pair_lengths(each) for each in flown])
    assert (np.diff(np.minimum(closest, SEPARATION), axis=0) >= -1e-9).all()


def test_nobody_leaves_the_box_and_strays_come_back():
    rng = np.random.default_rng(5)
    free = law(4, separation=0.0, box=2.0)
    flown = fly(rng, free, rng.uniform(-2.0, 2.0, (4, 2)), WISHES["storm"], 100)
    assert (np.abs(flown) <= 2.0).all()
    outside = np.array([[2.5, 0.0]])
    none = np.zeros((1, 1), dtype=bool)
    alone = law(1, separation=0.0, box=2.0)
    assert alone.step(outside, np.array([[-1.0, 0.0]]), none)[0, 0] == pytest.approx(2.0)
    assert alone.step(outside, np.array([[1.0, 0.0]]), none)[0, 0] == pytest.approx(2.5)


def test_hundreds_of_steps_of_a_crowd():
    rng = np.random.default_rng(6)
    flown = fly(rng, law(20), crowd(rng, 20), WISHES["turn"], 400)
    path = path_of(flown)
    assert smallest_separation(path).value >= SEPARATION
    assert widest_bottleneck(path, limit=RANGE, resolution=1e-10).value <= RANGE + 1e-9


@pytest.mark.parametrize("dimension", [2, 3])
def test_the_fan_points_everywhere(dimension):
    directions = fan(dimension)
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1.0)
    rng = np.random.default_rng(0)
    any_way = rng.normal(size=(200, dimension))
    any_way /= np.linalg.norm(any_way, axis=1)[:, None]
    assert (any_way @ directions.T).max(axis=1).min() > 0.95


def test_a_range_too_short_to_hear_whom_one_could_meet_is_refused():
    with pytest.raises(ValueError, match=r"at least 1\.5 m"):
        law(3, reach=1.2)
