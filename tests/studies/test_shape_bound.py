"""Lower bounds on the time to cover: exact where the best motion is known, below every motion elsewhere."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mpc_cover.mission.load import build_mission
from mpc_cover.studies.mission_transforms import moved, scaled
from mpc_cover.studies.robustness_shapes import crowds, islands, shapes
from mpc_cover.studies.shape_bound import distance_bound, formation_share, reach_bound, shape_bound
from mpc_cover.verification.area_bound import swath_bound


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 10_000), agents=st.integers(1, 4), radius=st.floats(0.1, 2.0))
def test_no_random_walk_that_comes_near_all_cells_is_shorter(seed, agents, radius):
    rng = np.random.default_rng(seed)
    path = np.cumsum(rng.normal(scale=3.0 * radius, size=(8, agents, 2)), axis=0)
    length = np.linalg.norm(np.diff(path, axis=0), axis=2).sum()
    cell = path.reshape(-1, 2) + rng.uniform(-0.5, 0.5, size=(8 * agents, 2)) * radius
    assert distance_bound(cell, path[0], radius) <= length + 1e-9


def test_a_line_of_cells_is_nearly_as_long_as_its_bound():
    cell = np.column_stack([np.arange(0.0, 1000.0, 1.0), np.zeros(1000)])
    assert 0.85 * 998.0 < distance_bound(cell, cell[:1], 1.0) <= 998.0


def test_the_farthest_cell_is_reached_by_accelerating_then_cruising():
    raw = shapes()["box"]
    raw["fleet"]["agents"] = raw["fleet"]["agents"][:1]
    del raw["fleet"]["communication_range_m"]
    mission = build_mission(raw, "one agent")
    farthest = np.linalg.norm(mission.field.cell - mission.fleet.start[0], axis=1).max() - 1.0
    assert reach_bound(mission) == pytest.approx(farthest / 1.5 + 0.5)


def test_tight_links_narrow_the_swath_of_a_fleet():
    by_range = crowds()["line of 6"]
    share = [formation_share(build_mission(raw, "crowd")) for raw in by_range.values()]
    assert share == pytest.approx([7.5 / 12.0, 8.0 / 12.0, 9.5 / 12.0, 1.0])


@pytest.mark.parametrize("raw", [*shapes().values(), *islands().values()], ids=lambda raw: raw["name"])
def test_the_bound_moves_and_scales_with_the_mission(raw):
    plain = shape_bound(build_mission(raw, "plain"))
    assert plain > (swath_bound(build_mission(raw, "plain")) or 0.0)
    assert shape_bound(build_mission(moved(raw, (1000.0, -500.0)), "moved")) == pytest.approx(plain, rel=0.05)
    assert shape_bound(build_mission(scaled(raw, 100.0), "scaled")) == pytest.approx(plain, rel=0.05)
