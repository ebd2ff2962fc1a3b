"""Between two steps the rest of the plan becomes shorter, covers no less, and is taken only where it is as safe."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from closed_loop import small_mission

from mpc_cover.control.factory import make_control_law
from mpc_cover.control.receding_horizon import RecedingHorizon
from mpc_cover.information.build import make_map
from mpc_cover.model.fleet_state import FleetState
from mpc_cover.planning.budget import Budget
from mpc_cover.service.run.simulate import simulate
from mpc_cover.verification.check import check_trajectory
from solvers.native import library

pytestmark = pytest.mark.skipif(library.library() is None, reason="there was no C compiler when it was built")


def share(mission, value):
    control = mission.spec.control.model_copy(update={"improvement_share": value})
    return replace(mission, spec=mission.spec.model_copy(update={"control": control}))


def test_after_a_loss_flights_with_idle_time_end_sooner_or_at_the_same_time():
    mission = small_mission(planning_time_s=0.3)
    ends = []
    for value in (0.0, 0.6):
        flown = simulate(share(mission, value), deaths={"a1": 2.0})
        assert flown.complete
        assert check_trajectory(flown.trajectory).holds
        ends.append(np.max(flown.trajectory.covered_at))
    assert ends[1] <= ends[0]


def test_with_counted_work_it_is_the_same_again():
    mission = share(small_mission(planning_time_s=0.3), 0.6)
    one, two = (simulate(mission, deaths={"a1": 2.0}).trajectory for _ in range(2))
    np.testing.assert_array_equal(one.position, two.position)


def test_what_was_found_is_not_taken_from_a_state_that_is_off_the_plan():
    mission = small_mission(planning_time_s=0.3)
    law, demand = RecedingHorizon(mission), make_map(mission)
    start = mission.fleet.start
    state = FleetState.nominal(start, np.zeros_like(start), 0.0)
    plan = law.step(replace(state, settled=True), demand, Budget.counted(0.3)).trajectory
    law.published(plan)
    while law.improve(Budget.counted(1.0)):
        pass
    period = mission.spec.control.period_s
    late = FleetState.nominal(plan.position[3], plan.velocity[3], 3.0 * period)  # two steps were missed
    after = law.step(late, demand, Budget.counted(0.2)).trajectory
    np.testing.assert_allclose(after.position[0], plan.position[3])


def test_a_law_in_a_local_frame_passes_idle_time_on():
    law = make_control_law(small_mission(), "native", 0)
    assert not law.improve(Budget.counted(0.1))  # nothing was sent yet
