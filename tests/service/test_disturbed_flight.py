"""The closed loop with disturbed agents: delays, noise, weakness and death, on a virtual clock."""

from collections import Counter

import numpy as np
import pytest
from service_fakes import Bench, SharingBrain, SweepLaw, small_mission, straight_plan

from mpc_cover.information.coverage_map import CoverageMap
from mpc_cover.service.protocol import bus
from mpc_cover.service.protocol.decoding import Reason
from mpc_cover.service.protocol.messages import encode
from mpc_cover.service.run.simulate import simulate
from mpc_cover.verification.check import check_trajectory

WINDY = {"position_noise_m": 0.02, "input_noise_m_per_s2": 0.03, "wind_m_per_s2": [0.0, 0.05]}


def failures(trajectory):
    return {check.name for check in check_trajectory(trajectory).failures}


@pytest.mark.parametrize("disturbance", [WINDY, {**WINDY, "delay_s": 0.5}, {"delay_s": 0.33}])
def test_the_mission_is_flown_and_the_record_is_true(disturbance):
    mission = small_mission(disturbance=disturbance)
    law = SweepLaw(mission)
    result = simulate(mission, law=law)
    assert result.complete
    assert failures(result.trajectory) <= {"speed"}  # this brain leaves no margin to its agents' speed
    assert np.isfinite(result.trajectory.covered_at).all()
    assert not [event for event in result.events if "ignores" in event or "strays" in event]


def test_the_same_seed_gives_the_same_flight_and_another_one_does_not():
    mission = small_mission(disturbance=WINDY)
    first, again, other = (simulate(mission, law=SweepLaw(mission), seed=seed) for seed in (4, 4, 5))
    np.testing.assert_array_equal(first.trajectory.position, again.trajectory.position)
    assert first.trajectory.position.shape != other.trajectory.position.shape or np.any(
        first.trajectory.position != other.trajectory.position
    )


def test_plans_start_from_the_reference_not_from_what_is_measured():
    bench = Bench(small_mission(disturbance=WINDY))
    fleet = [bench.agent("a1"), bench.agent("a2")]
    law = SweepLaw(bench.mission)
    controller = bench.controller(law)
    references = {}

    def note(_):
        for index, agent in enumerate(fleet):
            references.setdefault(round(agent.plant.time_s, 6), {})[index] = agent.plant.position.copy()

    bench.run(controller, until=lambda: controller.done, after=note)
    assert controller.exit_status == 0
    steps = [call for call in law.calls if call[0] == "step"]
    seen = 0
    for (_, start, _), (position, _) in zip(steps, law.predicted, strict=True):
        there = references.get(round(100.5 + start, 6), {})
        if len(there) == 2:
            np.testing.assert_allclose(position, [there[0], there[1]], atol=1e-9)
            seen += 1
    assert seen > 5
    assert not Counter(agent.rejected for agent in fleet if agent.rejected)


def test_the_map_never_claims_what_was_not_truly_measured():
    mission = small_mission(disturbance=WINDY)
    law = SweepLaw(mission)
    result = simulate(mission, law=law, seed=2)
    claimed, true = law.coverage.covered_at, result.trajectory.covered_at
    assert np.isfinite(claimed).all()
    assert (true <= claimed + 1e-6).all()


def test_the_margin_of_the_map_is_the_noise_unless_it_is_given():
    mission = small_mission(disturbance={"position_noise_m": 0.2})
    marked = []
    for coverage in (CoverageMap(mission), CoverageMap(mission, margin_m=0.0)):
        coverage.observe(0.0, mission.fleet.start)
        marked.append(coverage.covered_count)
    assert marked[0] < marked[1]


def test_a_slow_agent_is_found_out_and_planned_for_from_where_it_is():
    mission = small_mission(disturbance={"slow_agents": {"a2": 0.5}})
    law = SharingBrain(mission)
    result = simulate(mission, law=law)
    assert [index for index, _ in law.parts][:1] == [1]
    assert law.parts[-1][1] == pytest.approx(0.97 * 0.5, abs=0.02)
    assert "controller: a2 is slow: plans ask for 48% of its speed" in result.events
    assert "controller: a2 strays from its plan: the next one starts where it is" in result.events
    assert failures(result.trajectory) <= {"connectivity"}
    assert np.linalg.norm(result.trajectory.velocity[:, 1], axis=1).max() <= 0.5 + 1e-9


def test_nobody_is_called_slow_for_the_weather():
    mission = small_mission(disturbance=WINDY)
    for seed in range(5):
        law = SharingBrain(mission)
        simulate(mission, law=law, seed=seed)
        assert not law.parts


def test_reports_are_late_by_the_delay_and_plans_still_start_on_time():
    bench = Bench(small_mission(disturbance={"delay_s": 0.25}))
    bench.agent("a1")
    inbox = bench.hear(bench.keys.state("a1"))
    bench.run(seconds=1.0)
    delays = [item.received_s for item in inbox.drain()]
    np.testing.assert_allclose(delays, 100.25 + 0.1 * np.arange(len(delays)) - 0.1 * (np.arange(len(delays)) > 0))
    bench.agent("a2")
    controller = bench.controller(SweepLaw(bench.mission))
    bench.run(controller, until=lambda: controller.done)
    assert [link.offset for link in controller.fleet_monitor.links] == pytest.approx([0.0, 0.0], abs=1e-9)
    assert controller.exit_status == 0


def test_a_plan_from_beyond_reach_is_ignored_by_a_disturbed_agent_too():
    bench = Bench(small_mission(disturbance=WINDY))
    agent = bench.agent("a1")
    far = straight_plan(agent, 100.5)
    moved = [[x + 0.9, y] for x, y in far.position]
    publisher = bench.bus.join().publisher(bench.keys.plan("a1"), bus.PLAN)
    publisher.publish(encode(straight_plan(agent, 100.5, position=moved)))
    bench.run(seconds=0.3)
    assert agent.rejected == {Reason.START: 1}


@pytest.mark.parametrize("died_s", [0.7, 1.9])
def test_a_death_leaves_a_motion_that_could_have_been(died_s):
    mission = small_mission(height=8.0, reach=20.0, time_limit_s=12.0)
    result = simulate(mission, law=SharingBrain(mission, goal_y=7.0), deaths={"a2": died_s})
    trajectory = result.trajectory
    assert result.lost == ("a2",)
    assert not result.complete
    assert not failures(trajectory)
    assert trajectory.meta["lost"]["a2"] == pytest.approx(died_s, abs=0.11)
    after = trajectory.time > died_s + 1.5
    assert not trajectory.velocity[after, 1].any()
    assert np.ptp(trajectory.position[after, 0, 1]) > 1.0


def test_the_real_thing_finishes_without_a_dead_agent():
    mission = small_mission(height=6.0, reach=20.0)
    result = simulate(mission, deaths={"a2": 1.3})
    assert result.complete
    assert result.lost == ("a2",)
    assert check_trajectory(result.trajectory).holds
