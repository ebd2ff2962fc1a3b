"""The missions of chapters 5 and 6 that come along: each has a twin of double integrators."""

import pytest

from mpc_cover.distributed.setup import check_flyable
from mpc_cover.mission.load import load_mission, shipped_missions

FIGURES = {"fig-5-1", "fig-5-3", "fig-6-2", "fig-6-4"}


def test_every_simulation_of_chapters_5_and_6_has_a_mission():
    here = {path.stem for path in shipped_missions() if path.parent.name == "thesis-potential"}
    assert here == FIGURES


@pytest.mark.parametrize("name", sorted(FIGURES))
def test_every_one_of_them_has_a_twin_that_differs_in_its_dynamics_only(name):
    single, double = load_mission(name).spec, load_mission(f"{name}-double").spec
    assert (single.fleet.dynamics, double.fleet.dynamics) == ("single", "double")
    for section in ("area", "information", "potential", "looks"):
        assert getattr(single, section) == getattr(double, section)
    assert single.fleet.agents == double.fleet.agents
    assert single.control.period_s == double.control.period_s
    assert single.fleet.model_copy(update={"dynamics": "double", "defaults": double.fleet.defaults}) == double.fleet
    check_flyable(load_mission(f"{name}-double"))
