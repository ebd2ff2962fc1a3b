"""The same mission elsewhere, larger, smaller is flown the same: in closed loop and offline."""

import numpy as np
import pytest

from mpc_cover.mission.load import build_mission
from mpc_cover.planning.offline import PlanOptions, plan_mission
from mpc_cover.service.run.simulate import simulate
from mpc_cover.studies.mission_transforms import moved, scaled
from mpc_cover.studies.robustness_shapes import shapes
from mpc_cover.verification.check import check_trajectory
from mpc_cover.verification.summary import time_to_cover

RAW = shapes()["box"]
RAW["area"] = {**RAW["area"], "shape": {"kind": "box", "min_m": [0.0, 0.0], "max_m": [5.0, 5.0]}}
RAW["control"] = {**RAW["control"], "planning_time_s": 1.0}
RAW["planning"] = {"duration_s": 5.0}
CHANGES = {
    "far": lambda raw: moved(raw, (1e7, 1e7)),
    "utm": lambda raw: moved(raw, (5e5, 4.6e6)),
    "tiny": lambda raw: scaled(raw, 1e-3),
    "huge": lambda raw: scaled(raw, 1e3),
    "small and moved": lambda raw: moved(scaled(raw, 0.1), (1e4, -1e4)),
}


def flown(raw):
    recording = simulate(build_mission(raw, "flown")).trajectory
    assert check_trajectory(recording).holds
    return time_to_cover(recording, 99)


@pytest.fixture(scope="module")
def here():
    return flown(RAW)


@pytest.mark.parametrize("change", CHANGES.values(), ids=CHANGES)
def test_a_moved_or_scaled_mission_takes_as_long(change, here):
    assert flown(change(RAW)) == pytest.approx(here, rel=0.02)


@pytest.mark.parametrize("change", CHANGES.values(), ids=CHANGES)
def test_a_moved_or_scaled_plan_covers_as_much(change):
    plain, other = (plan_mission(build_mission(raw, "p"), PlanOptions(starts=3)) for raw in (RAW, change(RAW)))
    assert np.isfinite(other.covered_at).mean() == pytest.approx(np.isfinite(plain.covered_at).mean(), abs=0.01)
    assert check_trajectory(other).holds
