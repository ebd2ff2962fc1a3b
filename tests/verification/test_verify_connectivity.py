"""Connectivity at every instant, though the tree changes between samples."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse.csgraph
from flights import fleet_of, propagate
from hypothesis import given
from hypothesis import strategies as st
from test_verify_separation import flights

from mpc_cover.verification.connectivity import bottleneck, exchanged_bottlenecks, widest_bottleneck
from mpc_cover.verification.motion import verify_motion
from mpc_cover.verification.path import Path


def fly(start, speed, time, force=None):
    start, speed, time = np.array(start), np.array(speed), np.array(time)
    force = np.zeros((len(time) - 1, *start.shape)) if force is None else np.array(force)
    position, velocity = propagate(start, force, time, speed)
    return Path(time, position, velocity, force)


def connectivity(path, reach):
    fleet = fleet_of(path.position[0], communication_range=reach)
    report = verify_motion(fleet, path.time, path.position, path.velocity, path.force)
    return next(check for check in report.checks if check.name == "connectivity")


def ferry():
    """A third agent crosses from one resting agent to another: its edge of the tree changes half way."""
    return fly([[0.0, 0.0], [4.0, 0.0], [0.5, 0.0]], [[0, 0], [0, 0], [0.75, 0]], [0.0, 4.0])


@pytest.mark.parametrize("agents", [2, 3, 5, 9])
def test_bottleneck_agrees_with_scipy(agents):
    rng = np.random.default_rng(agents)
    points = rng.uniform(0, 5, (20, agents, 2))
    first, second = np.triu_indices(agents, k=1)
    length = np.linalg.norm(points[:, first] - points[:, second], axis=2)
    found = bottleneck(length, agents)
    for graph, value in zip(points, found, strict=True):
        distance = np.linalg.norm(graph[:, None] - graph[None], axis=2)
        tree = scipy.sparse.csgraph.minimum_spanning_tree(distance)
        assert value == pytest.approx(tree.toarray().max())


def test_the_tree_may_change_between_samples():
    # a3 leaves a1 for a2; no fixed edge of a3 stays within 3.6 m, but some edge always does
    path = ferry()
    assert connectivity(path, 3.6).holds
    ends = np.linalg.norm(path.position[:, 2] - path.position[:, 0], axis=1)
    assert ends.max() == pytest.approx(3.5)


def test_the_widest_moment_of_a_ferry_is_known():
    widest = widest_bottleneck(ferry())
    assert widest is not None
    # at the start a3 is 0.5 m from a1 and 3.5 m from a2
    assert widest.value == pytest.approx(3.5, abs=1e-6)
    assert widest.value >= 3.5


def test_a_detour_that_leaves_the_fleet_only_between_the_samples_is_found():
    # out at 2 m/s and back: at both samples 2 m away, 3 m in the middle
    path = fly([[0.0, 0.0], [2.0, 0.0]], [[0, 0], [2.0, 0]], [0.0, 2.0], [[[0, 0], [-2.0, 0]]])
    np.testing.assert_allclose(np.linalg.norm(path.position[:, 1], axis=1), 2.0)
    check = connectivity(path, 2.5)
    assert not check.holds
    assert check.margin == pytest.approx(-0.5, rel=0.02)
    assert check.margin <= -0.5
    assert connectivity(path, 3.0).holds
    assert connectivity(path, 3.0).margin == pytest.approx(0.0, abs=1e-6)


def test_the_moment_at_which_the_tree_changes_is_the_widest():
    # a3 passes a1 and a2 at 3 m; in between it is sqrt(10) m from both, and either fixed tree reaches 3.4 m
    path = fly([[0.0, 0.0], [2.0, 0.0], [0.0, 3.0]], [[0, 0], [0, 0], [1.7, 0]], [0.0, 1.0])
    widest = widest_bottleneck(path)
    assert widest is not None
    assert widest.value == pytest.approx(np.sqrt(10.0), abs=1e-6)
    assert widest.time == pytest.approx(1 / 1.7, abs=1e-6)
    assert connectivity(path, 3.17).holds
    assert connectivity(path, 3.1625).holds
    assert not connectivity(path, 3.16).holds


def test_edge_at_exactly_the_range_holds():
    path = fly([[0.0, 0.0], [5.5, 0.0]], [[1, 0], [1, 0]], [0.0, 1.0, 2.0])
    check = connectivity(path, 5.5)
    assert check.holds
    assert check.margin == pytest.approx(0.0, abs=1e-6)


def test_one_agent_is_always_connected():
    path = fly([[0.0, 0.0]], [[1.0, 0.0]], [0.0, 1.0])
    assert widest_bottleneck(path) is None
    fleet = fleet_of(path.position[0], communication_range=1.0, separation_min=1.0)
    report = verify_motion(fleet, path.time, path.position, path.velocity, path.force)
    assert report.holds
    assert not {"connectivity", "separation"} & {check.name for check in report.checks}


@given(flights())
def test_widest_bottleneck_of_random_flights_against_dense_sampling(path):
    agents = path.position.shape[1]
    first, second = path.pair
    _, dense = path.dense(100)
    sampled = bottleneck(np.linalg.norm(dense[:, first] - dense[:, second], axis=2), agents).max()
    widest = widest_bottleneck(path)
    assert widest is not None
    assert widest.value >= sampled - 1e-9
    assert widest.value <= sampled + 0.5 / 200 * 12.0 + 1e-6


@given(flights(), st.floats(0.1, 12.0))
def test_a_limit_saves_work_but_changes_no_verdict(path, reach):
    exact, quick = widest_bottleneck(path), widest_bottleneck(path, limit=reach)
    assert exact is not None
    assert quick is not None
    assert quick.value >= exact.value - 1e-6
    if abs(exact.value - reach) > 1e-5:
        assert (quick.value <= reach) == (exact.value <= reach)
        assert abs(quick.value - exact.value) <= 1e-6 + 0.011 * abs(reach - exact.value)


def exchanged(path, other, index):
    """Return a path of which one agent flies the other."""
    arrays = [
        np.where((np.arange(path.position.shape[1]) == index)[:, None], theirs, ours)
        for ours, theirs in (
            (path.position, other.position),
            (path.velocity, other.velocity),
            (path.force, other.force),
        )
    ]
    return Path(path.time, *arrays)


@given(flights())
def test_the_bottleneck_with_one_exchanged_is_bounded_from_above_and_closely(both):
    """Half of the agents are those of the one path, the others what each of them flies on the other path."""
    agents = both.position.shape[1] // 2
    path, other = (
        Path(both.time, both.position[:, part], both.velocity[:, part], both.force[:, part])
        for part in (slice(0, agents), slice(agents, 2 * agents))
    )
    bound = exchanged_bottlenecks(path, other)
    assert bound.shape == (agents,)
    for index in range(agents):
        widest = widest_bottleneck(exchanged(path, other, index))
        true = widest.value if widest is not None else 0.0
        sagitta = np.sqrt(2) * 4.0 * np.sqrt(both.position.shape[2]) * np.diff(both.time).max() ** 2 / 8.0
        assert true - 1e-6 <= bound[index] <= true + 2.0 * sagitta + 1e-9


def test_exchanges_of_a_large_fleet_are_worked_on_piece_by_piece(monkeypatch):
    rng, time = np.random.default_rng(1), 0.5 * np.arange(5)
    start = rng.uniform(0.0, 9.0, (7, 2))
    path, other = (fly(start, np.zeros((7, 2)), time, rng.uniform(-1.0, 1.0, (4, 7, 2))) for _ in range(2))
    at_once = exchanged_bottlenecks(path, other)
    monkeypatch.setattr("mpc_cover.verification.connectivity._MOST_EDGES", 200)
    assert exchanged_bottlenecks(path, other).tolist() == at_once.tolist()
