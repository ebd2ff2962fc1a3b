"""What every law owes the controller: a proposal is no plan until it is published."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from closed_loop import PERIOD, at_start, first_plan, holds, small_mission, start_flying, step_budget

from mpc_cover.control.control_law import PlanSource
from mpc_cover.control.factory import make_control_law
from mpc_cover.control.receding_horizon import RecedingHorizon
from mpc_cover.errors import UserError
from mpc_cover.information.build import make_map
from mpc_cover.mission.load import build_mission
from mpc_cover.model.fleet_state import FleetState
from mpc_cover.planning.budget import Budget
from mpc_cover.planning.planner import Planner


def test_single_integrators_are_refused_in_words():
    spec = small_mission().spec.model_dump(by_alias=True, exclude_none=True)
    spec["fleet"]["dynamics"] = "single"
    del spec["fleet"]["defaults"]["input_max_m_per_s2"]
    with pytest.raises(UserError, match=r"fleet\.dynamics single: .*--controller potential"):
        make_control_law(build_mission(spec, "small"), "piqp", 0)


def test_what_is_not_published_is_not_flown():
    """The next step goes on along the incumbent, as a law does that was not asked in between."""
    mission, coverage = small_mission(), make_map(small_mission())
    (law, plan), (other, same) = start_flying(mission), start_flying(mission)
    assert plan.velocity.tobytes() == same.velocity.tobytes()
    at = [FleetState.nominal(*plan.at(k * PERIOD), k * PERIOD) for k in range(4)]
    law.step(at[1], coverage, step_budget())  # comes too late, or is refused
    found, expected = (one.step(at[2], coverage, step_budget()) for one in (law, other))
    assert found.source is expected.source is PlanSource.NEW
    assert found.reason == expected.reason
    assert found.trajectory.velocity.tobytes() == expected.trajectory.velocity.tobytes()
    assert law.mode is other.mode


def test_a_flight_in_which_every_third_proposal_is_not_sent_finishes():
    mission = small_mission()
    law, coverage = RecedingHorizon(mission), make_map(mission)
    flown = first_plan(law, mission, coverage)
    for k in range(1, 60):
        coverage.observe(k * PERIOD, flown.at(k * PERIOD)[0])
        state = FleetState.nominal(*flown.at(k * PERIOD), k * PERIOD)
        if coverage.complete and np.abs(state.velocity).max() < 1e-9:
            break
        proposal = law.step(state, coverage, step_budget())
        assert holds(mission, proposal.trajectory, state)
        if k % 3:
            law.published(proposal.trajectory)
            flown = proposal.trajectory
    assert coverage.complete
    assert k * PERIOD < 12.0


class FindsOnce(Planner):
    """Finds one plan, and nothing after that."""

    def __init__(self):
        super().__init__("piqp")
        self.found = None

    def thorough(self, task, budget):
        if self.found is None:
            self.found = super().quick(task, budget)
            return self.found
        return replace(self.found, feasible=False)

    quick = thorough


@pytest.mark.parametrize("published", [True, False])
def test_a_first_plan_goes_on_only_if_it_was_published(published):
    """What was found and not sent is at best an old plan, whose ways are flown from here."""
    mission, coverage = small_mission(), make_map(small_mission())
    law = RecedingHorizon(mission, planner=FindsOnce())
    plan = law.step(at_start(mission), coverage, step_budget()).trajectory
    if published:
        law.published(plan)
    state = FleetState.nominal(*plan.at(PERIOD), PERIOD)
    after = law.step(state, coverage, Budget.counted(0.0))
    assert holds(mission, after.trajectory, state)
    goes_on = np.allclose(after.trajectory.velocity[:4], plan.velocity[1:5])
    assert goes_on == published
    assert published or after.source is PlanSource.BRAKE or after.reason.startswith("as before")


def test_a_trajectory_that_was_sent_without_the_law_is_the_incumbent():
    """Where nothing is found, what was sent last goes on, whoever made it."""
    mission = small_mission()
    planner = FindsOnce()
    plan = first_plan(RecedingHorizon(mission, planner=planner), mission)
    law = RecedingHorizon(mission, planner=planner)
    law.published(plan)
    state = FleetState.nominal(*plan.at(PERIOD), PERIOD)
    proposal = law.step(state, make_map(mission), step_budget())
    assert proposal.source is PlanSource.SHIFTED
    np.testing.assert_allclose(proposal.trajectory.velocity[:-1], plan.velocity[1:], atol=1e-12)
