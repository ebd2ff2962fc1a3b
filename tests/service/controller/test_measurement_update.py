"""A successor knows what was covered, and asks what was measured since."""

import numpy as np
import pytest
from mission_kinds import KINDS, mission_with
from service_fakes import Bench, CheckpointsInMemory
from sweep_laws import StraightSweepLaw

from mpc_cover.information.build import make_map
from mpc_cover.service.controller.checkpoint import FileCheckpoints
from mpc_cover.service.controller.state_directory import StateDirectory
from mpc_cover.service.protocol.messages import Phase


def test_it_goes_on_from_a_snapshot_and_asks_what_was_measured_since(bench, fleet, law):
    first = bench.controller(law, checkpoints=(checkpoints := CheckpointsInMemory()))
    bench.run(first, until=lambda: len(law.states) > 4)
    bench.run(seconds=20.0)  # the first is dead: nobody ticks it
    truth = bench.clock.now() - 100.5
    second = bench.controller(StraightSweepLaw(bench.mission), epoch=2, identity="second", resume=checkpoints.kept)
    bench.run(second, until=lambda: second.done)
    assert second.exit_status == 0
    assert second.coverage.complete
    assert np.all(second.coverage.first <= first.coverage.first)
    assert second.heartbeat.status.mission_time_s == pytest.approx(truth, abs=2.0)


@pytest.mark.parametrize("kind", ["looks", "kalman"])
def test_a_successor_counts_no_look_twice_and_misses_none(kind, tmp_path):
    """It takes up a checkpoint, and the agents' histories, which begin long before it."""
    information = KINDS[kind] | ({"looks": 6} if kind == "looks" else {"target_variance": 0.16})
    mission = mission_with(information, edge=3.5, radius=1.2)
    bench = Bench(mission)
    for name in ("a1", "a2"):
        bench.agent(name)
    with StateDirectory(tmp_path / "state") as folder:
        checkpoints = FileCheckpoints(folder, mission, monotonic=bench.clock.now)
        controller = bench.controller(StraightSweepLaw(mission), checkpoints=checkpoints)
        bench.run(controller, until=lambda: controller.mission_time_s > 3.3)
        bench.run(seconds=8.0)  # it died; the agents fly to the ends of their plans, and look on
        resume, text = FileCheckpoints(folder, mission).load()
        assert resume is not None, text
        successor = bench.controller(StraightSweepLaw(mission), epoch=2, identity="second", resume=resume)
        bench.run(successor, until=lambda: successor.phase is Phase.FLYING)
    known = successor.coverage.map
    np.testing.assert_array_less(0, known.done_at)  # nothing was lost to a bad restore
    whole = make_map(mission)
    states = sorted((s for n in ("a1", "a2") for s in bench.states(n)), key=lambda state: state.time_s)
    takeoff = states[0].time_s + 0.5
    now = bench.clock.now()
    for state in states:
        if state.time_s <= now:
            position = np.full((2, 2), np.nan)
            position[mission.fleet.ids.index(state.agent)] = state.position
            whole.observe(max(0.0, state.time_s - takeoff), position)
    for name, array in whole.map.kept.items():
        if name != "state":  # the order of two agents' readings at one instant is another
            np.testing.assert_allclose(known.kept[name], array, atol=1e-6, err_msg=name)
