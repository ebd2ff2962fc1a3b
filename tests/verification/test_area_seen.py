"""How much area came within range, whatever the cells say."""

from dataclasses import replace

import numpy as np
import pytest

from mpc_cover.mission.config import Area
from mpc_cover.mission.load import build_mission, load_mission
from mpc_cover.trajectory_file import Recording
from mpc_cover.verification.area_seen import area_seen, points_of


def hovering(mission, position):
    """Return a recording of a fleet that rests in (m, d) positions."""
    held = np.repeat(np.array(position, dtype=float)[None], 2, axis=0)
    still = np.zeros_like(held)
    unknown = np.full(mission.field.size, np.inf)
    return Recording(
        np.array([0.0, 1.0]), held, still, still[:1],
        cell=mission.field.cell, covered_at=unknown, agent_id=mission.fleet.ids, mission=mission,
    )  # fmt: skip


def test_three_discs_apart_are_seen_as_their_area():
    mission = load_mission("box-3")
    seen = area_seen(hovering(mission, [[2.0, 2.0], [7.0, 2.0], [5.0, 6.0]]))
    assert seen == pytest.approx(3.0 * np.pi / 100.0, rel=0.01)


@pytest.mark.parametrize("cell_size_m", [0.25, 0.9, 1.4])
def test_it_knows_nothing_of_the_cells(cell_size_m):
    mission = load_mission("box-3")
    area = mission.spec.area.model_copy(update={"cell_size_m": cell_size_m})
    raw = mission.spec.model_copy(update={"area": area}).model_dump(by_alias=True, mode="json", exclude_none=True)
    other = build_mission(raw, "other")
    place = [[2.0, 2.0], [4.0, 2.0], [3.0, 4.0]]
    assert area_seen(hovering(other, place)) == area_seen(hovering(mission, place))
    assert other.field.measure == pytest.approx(100.0)


def test_each_magnitude_must_be_measured():
    mission = load_mission("box-3")
    fleet = replace(mission.fleet, radius=np.array([[1.0, -np.inf], [-np.inf, 1.0], [-np.inf, -np.inf]]))
    both = replace(mission, fleet=fleet)
    assert area_seen(hovering(both, [[2.0, 2.0], [2.0, 2.0], [9.0, 9.0]])) == pytest.approx(np.pi / 100.0, rel=0.02)
    assert area_seen(hovering(both, [[2.0, 2.0], [8.0, 2.0], [9.0, 9.0]])) == 0.0


@pytest.mark.parametrize("weights", [None, {"values": [[1.0], [0.0]]}])
def test_points_fill_what_matters_evenly(weights):
    shape = {"kind": "polygon", "outline_m": [[0, 0], [20, 0], [20, 0.2], [0, 0.2]]}
    point = points_of(Area.model_validate({"shape": shape, "cell_size_m": 0.5, "weights": weights}))
    end = 20.0 if weights is None else 10.0
    share, _ = np.histogram(point[:, 0], np.linspace(0.0, end, 11))
    assert share == pytest.approx(point.shape[0] / 10, rel=0.02)
