"""Looks between samples: distances to the path, and the majoriser's rows on states."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from motions import PERIOD, grid, random_motion

from mpc_cover.coverage import between_samples
from mpc_cover.coverage.majoriser import Softness, build_majoriser, soft_cost
from mpc_cover.coverage.nearest import nearest_samples, remaining_weight
from mpc_cover.coverage.nearest_points import FAR
from mpc_cover.coverage.objective import coverage_cost
from mpc_cover.model.look_instants import InterSample, LookInstants
from mpc_cover.model.trajectory import Trajectory

CONTINUOUS = LookInstants(continuous=True)


def dense(position, velocity, points):
    """Return positions (Q, m, d) of a motion at so many instants of each interval, and its end."""
    motion = Trajectory.even(0.0, PERIOD, position, velocity, np.diff(velocity, axis=0) / PERIOD)
    return motion.at(np.linspace(0.0, motion.end_time, points * motion.steps + 1))[0]


def test_a_straight_pass_measures_what_it_passes_and_sampled_looks_do_not():
    position = np.array([[[0.0, 0.0]], [[8.0, 0.0]]])
    velocity = np.full((2, 1, 2), [16.0, 0.0])
    cell, radius, weight = np.array([[4.0, 0.9], [4.0, 1.5]]), np.array([[1.0]]), np.ones((1, 2))
    passing = InterSample(velocity, 0.5, CONTINUOUS)
    assert coverage_cost(position, cell, radius, weight, None, passing) == pytest.approx(0.5)
    assert coverage_cost(position, cell, radius, weight) == pytest.approx(np.hypot(4.0, 0.9) + np.hypot(4.0, 1.5) - 2.0)
    assert remaining_weight(position, cell, radius, weight, passing).tolist() == [[0.0, 1.0]]


def test_the_bend_of_the_path_counts_not_its_chord():
    position = np.zeros((2, 1, 2))
    velocity = np.array([[[0.0, 4.0]], [[0.0, -4.0]]])  # up to 1 m and back within 1 s
    passing = InterSample(velocity, 1.0, CONTINUOUS)
    found = nearest_samples(position, np.array([[0.0, 1.2]]), np.array([[0.1]]), np.ones((1, 1)), 2, between=passing)
    assert found.distance.min() == pytest.approx(0.2)
    assert found.part is not None
    assert found.part[0, np.argmin(found.distance[0])] == pytest.approx(0.5)


@pytest.mark.parametrize("pairs", [10**9, 0], ids=["all distances", "k-d tree"])
@given(seed=st.integers(0, 10**6), dimension=st.sampled_from([2, 3]))
def test_continuous_distances_are_those_to_the_path(pairs, seed, dimension):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(between_samples, "DENSE", pairs)
        rng = np.random.default_rng(seed)
        position, velocity = random_motion(rng, 6, 2, dimension)
        cell, radius = grid(4, 2.5, dimension), rng.uniform(0.5, 1.0, (2, 1))
        weight = np.ones((1, cell.shape[0]))
        found = nearest_samples(position, cell, radius, weight, 3, between=InterSample(velocity, PERIOD, CONTINUOUS))
        path = dense(position, velocity, 200)
        exact = (np.linalg.norm(path[:, :, None] - cell, axis=3) - radius[:, 0, None]).min(axis=(0, 1))
        least = found.excess.min(axis=1)
        near = exact < 1.0  # where it decides; of far cells another interval may be slightly nearer
        assert (least <= exact + 1e-9)[near].all(), "no sampled point is nearer"
        np.testing.assert_allclose(least, exact, atol=np.where(near, 2e-4, 2e-2).max())


@pytest.mark.parametrize("pairs", [10**9, 0], ids=["all distances", "k-d tree"])
@given(seed=st.integers(0, 10**6), count=st.integers(2, 5))
def test_several_looks_a_step_are_samples_of_the_path(pairs, seed, count):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(between_samples, "DENSE", pairs)
        rng = np.random.default_rng(seed)
        position, velocity = random_motion(rng, 5, 2)
        cell, radius, weight = grid(4, 2.5), rng.uniform(0.5, 1.0, (2, 1)), np.ones((1, 16))
        between = InterSample(velocity, PERIOD, LookInstants(per_step=count))
        exact = coverage_cost(dense(position, velocity, count), cell, radius, weight)
        assert coverage_cost(position, cell, radius, weight, None, between) == pytest.approx(exact)


@given(seed=st.integers(0, 10**6), count=st.integers(2, 6))
def test_no_interval_occurs_twice_for_a_cell(seed, count):
    position, velocity = random_motion(np.random.default_rng(seed), 5, 2)
    between = InterSample(velocity, PERIOD, LookInstants(per_step=count))
    found = nearest_samples(position, grid(4, 2.5), np.ones((2, 1)), np.ones((1, 16)), 6, between=between)
    for sample, excess in zip(found.sample, found.excess, strict=True):
        some = sample[excess < FAR]
        assert np.unique(some).size == some.size


@given(
    seed=st.integers(0, 10**6), size=st.floats(0.0, 2.0), beta=st.floats(0.5, 40.0), per_step=st.sampled_from([0, 3])
)
def test_the_majoriser_bounds_the_cost_of_every_motion_and_touches_at_its_own(seed, size, beta, per_step):
    instants = LookInstants(per_step=per_step) if per_step else CONTINUOUS
    rng = np.random.default_rng(seed)
    position, velocity = random_motion(rng, 5, 2)
    cell, radius, softness = grid(3, 2.5), rng.uniform(0.5, 1.0, (2, 1)), Softness(beta, 0.1, count=5)
    weight = rng.uniform(0.1, 1.0, (1, 9))
    between = InterSample(velocity, PERIOD, instants)
    majoriser = build_majoriser(position, cell, radius, weight, softness, None, between)
    assert majoriser.cost == pytest.approx(soft_cost(position, cell, radius, weight, softness, None, between))
    force = np.diff(velocity, axis=0) / PERIOD + size * rng.normal(size=(5, 2, 2))
    later = np.concatenate([velocity[:1], velocity[0] + PERIOD * np.cumsum(force, axis=0)])
    moved = Trajectory.from_velocities(position[0], velocity[0], later[1:], 0.0, PERIOD)
    true = soft_cost(moved.position, cell, radius, weight, softness, None, InterSample(later, PERIOD, instants))
    # the same points of the same intervals, with their true distances, bound the cost from above
    assert majoriser.blend is not None
    points = [at_parts(q, v, majoriser) for q, v in ((position, velocity), (moved.position, later))]
    old, new = (np.linalg.norm(p - cell[:, None], axis=2) for p in points)
    bound = majoriser.weight @ np.maximum(majoriser.level + (majoriser.share * (new - old)).sum(axis=1), 0.0)
    # a nearer interval that was not among those may lower a soft minimum of finitely many, never raise it
    assert true <= bound + 1e-9 + weight.sum() * np.log(5) / beta


def at_parts(position, velocity, majoriser):
    """Return the points (R, M, d) of a motion that a majoriser's terms are at."""
    dimension = position.shape[2]
    following = np.concatenate([velocity[1:], velocity[-1:]]).reshape(-1, dimension)
    flat = (position.reshape(-1, dimension), velocity.reshape(-1, dimension), following)
    q, v, after = (part[majoriser.sample] for part in flat)
    a, b = majoriser.blend
    return q + a[..., None] * v + b[..., None] * after


@given(seed=st.integers(0, 10**6))
def test_gradients_by_states_are_those_of_the_soft_cost_by_finite_differences(seed):
    rng = np.random.default_rng(seed)
    position, velocity = random_motion(rng, 3, 2)
    cell = grid(3, 3.0) + 14.0  # far away: no kink of pos, and all few intervals are nearest
    radius, weight = np.full((2, 1), 0.5), rng.uniform(0.5, 1.0, (1, 9))
    softness, instants = Softness(1.5, 0.2, count=8), LookInstants(per_step=3)

    def cost(q, v):
        return soft_cost(q, cell, radius, weight, softness, None, InterSample(v, PERIOD, instants))

    majoriser = build_majoriser(position, cell, radius, weight, softness, None, InterSample(velocity, PERIOD, instants))
    every = majoriser.level > 0.0
    assert majoriser.blend is not None
    by_position = majoriser.gradient(every, 8).reshape(position.shape)
    by_velocity = majoriser.gradient(every, 8, majoriser.blend[0]).reshape(position.shape)
    by_velocity[1:] += majoriser.gradient(every, 8, majoriser.blend[1]).reshape(position.shape)[:-1]
    for index in np.ndindex(position.shape):
        step = np.zeros_like(position)
        step[index] = 1e-6
        slope = (cost(position + step, velocity) - cost(position - step, velocity)) / 2e-6
        assert by_position[index] == pytest.approx(slope, abs=1e-4)
        slope = (cost(position, velocity + step) - cost(position, velocity - step)) / 2e-6
        assert by_velocity[index] == pytest.approx(slope, abs=1e-4)
