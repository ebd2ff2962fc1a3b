"""Blocks of cells: who covers a block's point covers all its cells, and a fine mission flies like a coarser one."""

import numpy as np
import pytest
from tiny_mission import TINY

from mpc_cover.mission.load import build_mission
from mpc_cover.model.cell_blocks import CellBlocks
from mpc_cover.planning.offline import PlanOptions, plan_mission
from mpc_cover.service.run.simulate import simulate
from mpc_cover.verification.check import check_trajectory


def fine(size, **area):
    return build_mission({**TINY, "area": {**TINY["area"], "cell_size_m": size, **area}}, "fine")


@pytest.mark.parametrize("size", [0.025, 0.03, 0.0475])
def test_who_covers_a_block_covers_its_cells(size):
    mission = fine(size)
    blocks = CellBlocks.of(mission)
    assert blocks is not None
    planned = blocks.mission(mission)
    assert planned.field.size <= 1100
    np.testing.assert_array_equal(np.sort(blocks.order), np.arange(mission.field.size))
    rng = np.random.default_rng(0)
    for place in rng.uniform(0.0, 3.0, size=(20, 2)):
        near = np.linalg.norm(planned.field.cell - place, axis=1) <= planned.fleet.radius[0, 0]
        missed = np.linalg.norm(mission.field.cell - place, axis=1) > mission.fleet.radius[0, 0]
        assert not (blocks.any(missed[None])[0] & near).any()
    assert planned.field.measure == pytest.approx(mission.field.measure)


def test_what_any_cell_is_owed_its_block_is_owed():
    mission = fine(0.03)
    blocks = CellBlocks.of(mission)
    owed = np.zeros((1, mission.field.size), dtype=bool)
    owed[0, 1234] = True
    assert blocks.any(owed).sum() == 1
    assert blocks.most(owed.astype(float)).sum() == 1.0


def test_coarse_cells_have_no_blocks():
    assert CellBlocks.of(fine(0.5)) is None
    assert CellBlocks.of(fine(0.1)) is None


def test_a_fine_mission_is_covered_in_flight_and_by_a_plan():
    mission = fine(0.03)
    flight = simulate(mission).trajectory
    assert np.isfinite(flight.covered_at).all()
    assert check_trajectory(flight).holds
    plan = plan_mission(mission, PlanOptions(starts=2))
    assert np.isfinite(plan.covered_at).all()
