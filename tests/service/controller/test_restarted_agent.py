"""An agent whose process is killed in flight and started again at its start: the fleet goes on without a long wait."""

from service_fakes import Bench

from mpc_cover.control.factory import make_control_law
from mpc_cover.mission.load import build_mission
from mpc_cover.service.protocol.messages import Phase


def four_on_a_square():
    starts = [[0.8, 0.8], [1.8, 0.8], [0.8, 1.8], [1.8, 1.8]]
    raw = {
        "schema": 1,
        "name": "square",
        "area": {"shape": {"kind": "box", "min_m": [0, 0], "max_m": [6, 6]}, "cell_size_m": 0.5},
        "fleet": {
            "defaults": {"sensing_radius_m": 0.9, "input_max_m_per_s2": 1.5, "speed_max_m_per_s": 1.5},
            "agents": [{"id": f"a{i + 1}", "start_m": at} for i, at in enumerate(starts)],
            "separation_min_m": 0.5,
            "communication_range_m": 4.0,
        },
        "control": {"horizon_steps": 16, "planning_time_s": 1.0},
    }
    return build_mission(raw, "square")


def test_no_wait_for_the_fleet_to_come_to_rest_takes_a_horizon():
    """If everyone stops to plan anew, that takes 1 s of braking; the horizon is 8 s."""
    bench = Bench(four_on_a_square())
    fleet = {name: bench.agent(name) for name in bench.mission.fleet.ids}
    controller = bench.controller(make_control_law(bench.mission, "piqp", 0))
    enough = 0.396 * bench.mission.field.size
    bench.run(controller, until=lambda: controller.coverage.covered_count >= enough)
    bench.kill(fleet["a3"])
    bench.run(controller, seconds=1.5)
    bench.agent("a3", instance="another-life")
    waited = []

    def note(who):
        if who is controller and controller.phase is Phase.WAITING:
            waited.append(bench.clock.now())

    bench.run(controller, until=lambda: controller.done, seconds=60.0, after=note)
    assert controller.exit_status == 0
    assert "a3 is back" in " ".join(bench.said)
    assert max(waited, default=0.0) - min(waited, default=0.0) <= 1.0 + 2 * 0.5
