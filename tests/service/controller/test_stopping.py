"""Pause, abort and finish in flight: the first two brake now, safely; the third flies the plan to its end."""

import numpy as np
import pytest
from service_fakes import Bench, small_mission
from sweep_laws import StraightSweepLaw

from mpc_cover.control.factory import make_control_law
from mpc_cover.mission.load import build_mission
from mpc_cover.service.protocol.messages import CommandRequest, Phase, encode
from mpc_cover.service.run.recording import merge
from mpc_cover.verification.check import check_trajectory


def send(bench, name, request="r"):
    return bench.bus.join().post(bench.keys.command(name), encode(CommandRequest(request=request)))


def tall_bench(channel=None, **control):
    """Two agents on their way up a mission of several horizons."""
    bench = Bench(small_mission(height=30.0, **{"horizon_steps": 40, **control}), channel)
    fleet = [bench.agent("a1"), bench.agent("a2")]
    law = StraightSweepLaw(bench.mission, goal_y=29.5)
    controller = bench.controller(law)
    bench.run(controller, until=lambda: len(law.in_flight) >= 6)
    return bench, fleet, law, controller


def at_rest(fleet):
    return lambda: all(np.linalg.norm(agent.plant.velocity) < 1e-6 for agent in fleet)


def braking_s(mission):
    return float((mission.fleet.speed_max / mission.fleet.input_max).max())


@pytest.mark.parametrize(("name", "phase"), [("pause", Phase.WAITING), ("abort", Phase.FAILED)])
def test_pause_and_abort_brake_now(name, phase):
    bench, fleet, _, controller = tall_bench()
    begun = bench.clock.now()
    send(bench, name)
    bench.run(controller, until=at_rest(fleet))
    assert bench.clock.now() - begun <= braking_s(bench.mission) + 2 * 0.5
    assert controller.phase is phase
    assert "everyone brakes" in " ".join(bench.said)
    bench.run(controller, seconds=3.0)
    assert at_rest(fleet)()
    assert not any(agent.rejected for agent in fleet)
    assert controller.done == (name == "abort")


def test_finish_flies_the_plan_to_its_end(law):
    bench, fleet, law, controller = tall_bench(horizon_steps=12)
    answers, sent = send(bench, "finish"), law.sent[-1]
    bench.run(controller, until=lambda: controller.done)
    np.testing.assert_allclose([agent.plant.position for agent in fleet], sent.position[-1], atol=1e-9)
    assert controller.phase is Phase.STOPPED
    assert controller.exit_status == 1, "most is not covered"
    assert answers[0][0]


def test_a_controller_that_is_to_stay_ends_when_it_is_told_to_finish(bench, fleet, law):
    controller = bench.controller(law, stay=True)
    bench.run(controller, until=lambda: controller.phase is Phase.COMPLETE)
    send(bench, "finish")
    bench.run(controller, until=lambda: controller.done, seconds=3.0)
    assert controller.done
    assert controller.exit_status == 0


def test_mission_time_stands_still_while_everyone_rests_after_a_pause():
    bench, _, _, controller = tall_bench()
    send(bench, "pause")
    bench.run(controller, until=lambda: controller.heartbeat.text == "paused")
    before = controller.mission_time_s
    bench.run(controller, seconds=5.0)
    assert controller.mission_time_s == before
    send(bench, "resume", "r2")
    bench.run(controller, until=lambda: controller.phase is Phase.FLYING, seconds=3.0)
    assert controller.phase is Phase.FLYING


def test_who_has_not_got_the_stop_is_sent_another():
    lose = []
    bench, fleet, _, controller = tall_bench(lambda key, payload: [] if key in lose else [payload])
    lose.append(bench.keys.plan("a1"))
    begun = bench.clock.now()
    send(bench, "pause")
    bench.run(controller, until=at_rest(fleet[1:]))
    assert not at_rest(fleet)()
    lose.clear()
    bench.run(controller, until=at_rest(fleet))
    assert bench.clock.now() - begun <= 2 * braking_s(bench.mission) + 4 * 0.5


def test_a_law_that_fails_is_not_needed_for_a_stop():
    bench, fleet, law, controller = tall_bench()
    law.raises = ZeroDivisionError("a bug")
    begun = bench.clock.now()
    send(bench, "abort")
    bench.run(controller, until=at_rest(fleet))
    assert bench.clock.now() - begun <= braking_s(bench.mission) + 2 * 0.5


def crowd(horizon_steps=20):
    """Four agents that keep changing places on a patrol of a small field, within tight bounds."""
    starts = [[1.0, 1.0], [2.0, 1.0], [1.0, 2.0], [2.0, 2.0]]
    raw = {
        "schema": 1,
        "name": "crowd",
        "area": {"shape": {"kind": "box", "min_m": [0, 0], "max_m": [6, 6]}, "cell_size_m": 0.5},
        "fleet": {
            "defaults": {"sensing_radius_m": 0.8, "input_max_m_per_s2": 1.3, "speed_max_m_per_s": 1.7},
            "agents": [{"id": f"a{i + 1}", "start_m": at} for i, at in enumerate(starts)],
            "separation_min_m": 0.6,
            "communication_range_m": 3.0,
        },
        "information": {"kind": "ageing", "age_limit_s": 20.0},
        "control": {"horizon_steps": horizon_steps, "planning_time_s": 0.2, "time_limit_s": 5000.0},
    }
    return build_mission(raw, "crowd")


@pytest.mark.parametrize("moments", [6, pytest.param(100, marks=pytest.mark.slow)])
def test_at_rest_within_braking_time_and_two_periods_at_random_moments(moments):
    mission, random = crowd(), np.random.default_rng(11)
    bench = Bench(mission)
    fleet = [bench.agent(name) for name in mission.fleet.ids]
    controller = bench.controller(make_control_law(mission, "piqp", 0))
    took = []
    for number in range(moments):
        bench.run(controller, until=lambda: controller.phase is Phase.FLYING, seconds=20.0)
        bench.run(controller, seconds=float(random.uniform(1.0, 4.0)))
        bench.wait_until(bench.clock.now() + float(random.uniform(0.0, 0.1)))  # on nobody's tick
        begun = bench.clock.now()
        send(bench, "pause", f"p{number}")
        bench.run(controller, until=at_rest(fleet))
        took.append(bench.clock.now() - begun)
        bench.run(controller, until=lambda: controller.heartbeat.text == "paused", seconds=3.0)
        send(bench, "resume", f"r{number}")
    assert max(took) <= braking_s(mission) + 2 * mission.spec.control.period_s + 1e-9
    flown = merge(mission, [bench.records[name].pieces for name in mission.fleet.ids], {})
    failed = [check for check in check_trajectory(flown).checks if not check.holds]
    assert not failed, failed
    assert not any(agent.rejected for agent in fleet)
