"""Windows of the grid find exactly the cells that all distances find."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from maps_fixtures import box_field, flight, odd_fields, seeing

from mpc_cover.information.looks import joined
from mpc_cover.information.visibility import Visibility
from mpc_cover.model.sensing import measured

FIELDS = [box_field(), *odd_fields()]


def seen(looks, shape):
    mask = np.zeros(shape, dtype=bool)
    mask.reshape(-1)[looks.place] = True
    return mask


@settings(max_examples=150)
@given(seed=st.integers(0, 10**6), which=st.integers(0, len(FIELDS) - 1))
def test_equals_the_dense_model(seed, which):
    rng = np.random.default_rng(seed)
    field, agents = FIELDS[which], 4
    radius = rng.uniform(0.1, 3.0, (agents, 2))
    radius[rng.random((agents, 2)) < 0.3] = -np.inf
    position = flight(rng, field, 2, agents, 2.0)[1]
    if rng.random() < 0.5:  # exactly on the rim, and exactly on a cell
        radius[0, 0], position[0] = 1.0, field.cell[0]
        position[1] = field.cell[-1]
        position[1, 0] += 1.0
        radius[1] = 1.0
    sight = Visibility(field, radius)
    looks = sight.looks(2.5, position)
    assert (seen(looks, sight.shape) == measured(position, field.cell, radius)).all()
    magnitude, cell = np.divmod(looks.place, field.size)
    distance = np.linalg.norm(position[looks.agent] - field.cell[cell], axis=1)
    np.testing.assert_allclose(looks.distance, distance, atol=1e-12)
    assert (looks.radius == radius[looks.agent, magnitude]).all()
    assert (looks.time_s == 2.5).all()
    each = np.stack([looks.agent, looks.place])
    assert np.unique(each, axis=1).shape[1] == looks.count, "each agent looks at a place once"


def test_positions_that_are_no_numbers_or_out_of_this_world_see_nothing():
    field = box_field()
    position = np.array([[np.nan, 1.0], [1e300, -1e300], [np.inf, 0.0], [1.0, 1.0]])
    looks = seeing(field, 4).looks(0.0, position)
    assert set(looks.agent.tolist()) == {3}


def test_rows_may_be_some_agents_of_the_fleet():
    field = box_field()
    sight = Visibility(field, np.array([[0.5], [1.0], [2.0]]))
    alone = sight.looks(0.0, np.array([[2.0, 2.0]]), np.array([2]))
    assert set(alone.agent.tolist()) == {2}
    assert (alone.radius == 2.0).all()
    every = sight.looks(0.0, np.tile([2.0, 2.0], (3, 1)))
    assert every.where(every.agent == 2).count == alone.count
    assert joined([alone, alone.where(alone.distance < 0.5)]).count > alone.count


def test_cells_off_the_grid_are_refused():
    field = box_field()
    with pytest.raises(ValueError, match="grid"):
        seeing(replace(field, cell=field.cell + 0.1))
    with pytest.raises(ValueError, match="grid"):
        seeing(replace(field, cell=field.cell + 100.0))
