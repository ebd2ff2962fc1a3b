"""The local tree of 6.1.2 against brute force, on thousands of random graphs with ties of all kinds."""

from __future__ import annotations

import numpy as np
import pytest

from mpc_cover.constraints.local_tree import (
    distances,
    edge_ranks,
    kept_by_both,
    kept_by_either,
    local_choices,
    redundant_choices,
)


def kruskal(weight, reach, vertices):
    """Return the set of edges of the minimum spanning forest, in the order (weight, i, j)."""
    vertices = sorted(vertices)
    edges = sorted((weight[i, j], i, j) for i in vertices for j in vertices if i < j and weight[i, j] <= reach)
    leader = {v: v for v in vertices}

    def find(v):
        while leader[v] != v:
            v = leader[v]
        return v

    tree = set()
    for _, i, j in edges:
        if find(i) != find(j):
            leader[find(i)] = find(j)
            tree.add((i, j))
    return tree


def connected(mask):
    reached = {0}
    while True:
        more = reached | {int(j) for i in reached for j in np.flatnonzero(mask[i])}
        if more == reached:
            return len(reached) == len(mask)
        reached = more


def edges_of(mask):
    return {(int(i), int(j)) for i, j in zip(*np.nonzero(mask), strict=True) if i < j}


def random_positions(rng):
    """Return agents in general position, on a grid (equidistant), in pairs on one spot, on a ring, on a line."""
    agents = int(rng.integers(1, 13))
    kind = int(rng.integers(6))
    if kind == 0:
        return rng.uniform(0.0, 4.0, (agents, 2))
    if kind == 1:
        return rng.integers(0, 4, (agents, 2)).astype(float)
    if kind == 2:
        return rng.uniform(0.0, 4.0, (agents, 2))[rng.integers(0, agents, agents)]
    if kind == 3:
        angle = 2.0 * np.pi * np.arange(agents) / agents
        return 1.5 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    if kind == 4:
        return np.stack([rng.permutation(agents).astype(float), np.zeros(agents)], axis=1)
    return rng.uniform(0.0, 3.0, (agents, 3))


@pytest.mark.parametrize("batch", range(4))
def test_contains_the_spanning_tree_is_symmetric_and_connected(batch):
    rng = np.random.default_rng(batch)
    linked = 0
    for _ in range(750):
        position = random_positions(rng)
        weight = distances(position)
        assert (weight == weight.T).all()
        reach = float(rng.choice([1.0, 1.5, 2.5, 10.0]))
        choice = local_choices(weight, reach)
        tree = kruskal(weight, reach, range(len(position)))
        both, either = kept_by_both(choice), kept_by_either(choice)
        assert (both == both.T).all()
        assert (either == either.T).all()
        assert tree <= edges_of(both) <= edges_of(either)
        assert all(weight[edge] <= reach for edge in edges_of(either))
        assert not choice.diagonal().any()
        if connected((weight <= reach) & ~np.eye(len(position), dtype=bool)):
            linked += 1
            assert connected(both)
    assert linked > 200


def test_each_row_is_the_local_tree_of_that_neighbourhood_alone():
    rng = np.random.default_rng(10)
    for _ in range(400):
        position = random_positions(rng)
        weight = distances(position)
        reach = float(rng.choice([1.0, 1.5, 2.5]))
        choice = local_choices(weight, reach)
        for i in range(len(position)):
            near = np.flatnonzero((weight[i] <= reach) | (np.arange(len(position)) == i))
            expected = {j for edge in kruskal(weight, reach, near) if i in edge for j in edge if j != i}
            assert set(np.flatnonzero(choice[i])) == expected
            # and an agent that knows nothing else comes to the same
            me = int(np.flatnonzero(near == i)[0])
            own = local_choices(distances(position[near]), reach)[me]
            assert set(near[own]) == expected


def test_an_equilateral_triangle_keeps_the_two_edges_of_the_lower_ids():
    """Without a total order the intersection of three different trees may be one edge, or none."""
    position = np.array([[0.0, 0.0], [1.0, 0.0], [0.5, np.sqrt(0.75)]])
    weight = np.round(distances(position), 12)
    assert len({weight[0, 1], weight[0, 2], weight[1, 2]}) == 1
    assert edges_of(kept_by_both(local_choices(weight, 2.0))) == {(0, 1), (0, 2)}


def test_a_fleet_on_one_spot_is_a_star():
    choice = local_choices(distances(np.zeros((5, 2))), 1.0)
    assert edges_of(kept_by_both(choice)) == {(0, 1), (0, 2), (0, 3), (0, 4)}


def test_one_end_may_choose_what_the_other_does_not():
    """0 knows a way of shorter edges to 1 by 2 and 3; 1 does not hear 2, and keeps its edge to 0."""
    position = np.array([[0.0, 0.0], [2.6, 0.0], [-0.2, 1.8], [2.2, 1.9]])
    choice = local_choices(distances(position), 3.0)
    assert choice[1, 0]
    assert not choice[0, 1]
    assert edges_of(kept_by_both(choice)) == {(0, 2), (2, 3), (1, 3)}
    assert edges_of(kept_by_either(choice)) == {(0, 1), (0, 2), (2, 3), (1, 3)}


def test_weights_need_not_be_distances():
    rng = np.random.default_rng(2)
    for _ in range(300):
        weight = np.triu(rng.integers(0, 6, (9, 9)), 1).astype(float)
        weight += weight.T
        tree = kruskal(weight, 3.0, range(9))
        assert tree <= edges_of(kept_by_both(local_choices(weight, 3.0)))


def test_an_agent_that_is_nowhere_has_no_edges():
    position = np.array([[0.0, 0.0], [np.nan, 0.0], [1.0, 0.0]])
    choice = local_choices(distances(position), 5.0)
    assert edges_of(kept_by_both(choice)) == {(0, 2)}
    assert (edge_ranks(distances(position), 5.0)[1] == 9).all()


def test_nobody_and_one_alone():
    assert local_choices(np.zeros((0, 0)), 1.0).shape == (0, 0)
    assert not local_choices(np.zeros((1, 1)), 1.0).any()


def test_spare_edges_hold_the_tree_without_any_one_agent():
    rng = np.random.default_rng(11)
    for _ in range(300):
        position = random_positions(rng)
        agents, reach = len(position), float(rng.uniform(0.5, 4.0))
        weight = distances(position)
        chosen = redundant_choices(weight, reach)
        kept = edges_of(kept_by_both(chosen))
        assert edges_of(kept_by_both(local_choices(weight, reach))) <= kept
        for lost in range(agents):
            assert kruskal(weight, reach, set(range(agents)) - {lost}) <= kept


def test_spare_edges_of_a_neighbourhood_are_those_of_the_fleet():
    rng = np.random.default_rng(12)
    for _ in range(100):
        position = random_positions(rng)
        weight, reach = distances(position), float(rng.uniform(0.5, 4.0))
        whole = redundant_choices(weight, reach)
        for i in range(len(position)):
            near = [j for j in range(len(position)) if j == i or weight[i, j] <= reach]
            own = redundant_choices(weight[np.ix_(near, near)], reach)[near.index(i)]
            assert [near[k] for k in np.flatnonzero(own)] == np.flatnonzero(whole[i]).tolist()
