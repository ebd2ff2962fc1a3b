"""The state of the fleet that plans are made for: who takes part, and where the lost come to rest."""

import numpy as np
import pytest
from service_fakes import CheckpointsInMemory
from sweep_laws import SharingLaw, StraightSweepLaw

from mpc_cover.model.trajectory import SNAP_S
from mpc_cover.service.agent.schedule import Plant, Schedule, predict
from mpc_cover.service.protocol.messages import Phase


@pytest.fixture
def law(mission):
    return SharingLaw(mission)


@pytest.fixture
def controller(bench, fleet, law):
    controller = bench.controller(law)
    bench.run(controller, until=lambda: len(law.in_flight) >= 3)
    return controller


def steps_after(law):
    """Return a condition: two more steps were made."""
    count = len(law.in_flight)
    return lambda: len(law.in_flight) >= count + 2


def test_a_settled_fleet_is_planned_for_once_and_then_one_in_flight(bench, fleet, law, controller):
    first, *others = law.states
    assert first.settled
    np.testing.assert_array_equal(first.position, bench.mission.fleet.start)
    assert not first.velocity.any()
    assert not any(state.settled for state in others)
    for state in law.states:
        assert not state.lost.any()
        assert not state.obstacles
        np.testing.assert_array_equal(state.speed_share, 1.0)


@pytest.mark.parametrize("later_s", [0.0, 0.1, 0.2, 0.3, 0.4])
def test_a_dead_agent_is_where_its_deadman_stops_it(bench, fleet, law, controller, later_s):
    bench.run(controller, until=lambda: np.linalg.norm(fleet[1].plant.velocity) > 0.5)
    bench.run(controller, seconds=later_s)  # at any phase of the controller's period
    bench.kill(fleet[1])
    last = fleet[1].plant
    bench.run(controller, until=lambda: law.lost)
    bench.run(controller, until=steps_after(law))
    stop, _ = predict(Plant(last.time_s, last.position, last.velocity), Schedule(1.0), last.time_s + 9.0)
    for state in law.in_flight[-2:]:
        np.testing.assert_allclose(state.position[1], stop, atol=1e-9)
        assert not state.velocity[1].any()


def test_until_a_dead_agent_has_stopped_it_is_an_obstacle_that_moves(bench, fleet, law, controller):
    bench.run(controller, until=lambda: np.linalg.norm(fleet[1].plant.velocity) > 0.5)
    bench.kill(fleet[1])
    last = Plant(fleet[1].plant.time_s, fleet[1].plant.position, fleet[1].plant.velocity)
    bench.run(controller, until=lambda: law.lost)
    bench.run(controller, until=steps_after(law))
    origin_s = bench.clock.now() - controller.mission_time_s
    after = [state for state in law.in_flight if state.lost[1]]
    moving = [state for state in after if state.obstacles]
    assert moving == after[: len(moving)]
    assert len(moving) < len(after)
    for state in moving:
        (course,) = state.obstacles.values()
        assert list(state.obstacles) == [1]
        assert course.end_time > state.time
        for time_s in np.linspace(state.time, course.end_time, 5):
            truth = predict(last, Schedule(1.0), origin_s + time_s)
            np.testing.assert_allclose(course.at(time_s, SNAP_S), truth, atol=1e-6)


def test_nothing_more_is_sent_to_the_lost(bench, fleet, law, controller):
    bench.kill(fleet[1])
    bench.run(controller, until=lambda: law.lost)
    bench.plans("a2")
    bench.run(controller, until=steps_after(law))
    assert not bench.plans("a2")
    assert bench.plans("a1")


def test_plans_are_numbered_on(bench, fleet, law, controller):
    """Whoever stays sees no gap and no repeat in its plans when another is lost."""
    bench.kill(fleet[1])
    bench.run(controller, until=lambda: law.lost)
    bench.run(controller, until=steps_after(law))
    numbers = [plan.seq for plan in bench.plans("a1")]
    assert numbers == list(range(len(numbers)))


def test_what_only_the_lost_can_measure_is_out_of_reach(bench, fleet, law, controller):
    everything = controller.supervisor.reachable
    assert everything.all()
    bench.kill(fleet[1])
    bench.run(controller, until=lambda: law.lost)
    able = controller.supervisor.reachable
    lost_at = law.in_flight[-1].position[1]
    away = np.linalg.norm(bench.mission.field.cell - lost_at, axis=1)
    assert able.shape == everything.shape
    assert able[:, away > 1.5].all()


def test_a_law_that_cannot_share_makes_everyone_wait(bench, fleet):
    law = StraightSweepLaw(bench.mission)
    controller = bench.controller(law)
    bench.run(controller, until=lambda: len(law.in_flight) >= 3)
    bench.kill(fleet[1])
    bench.run(controller, until=lambda: controller.phase is Phase.WAITING, seconds=5.0)
    assert "a2 not heard for 2 s: everyone finishes its plan and waits" in " ".join(bench.said)


def test_a_successor_knows_who_was_lost_and_where(bench, fleet, mission, law):
    checkpoints = CheckpointsInMemory()
    first = bench.controller(law, checkpoints=checkpoints)
    bench.run(first, until=lambda: len(law.in_flight) >= 3)
    bench.kill(fleet[1])
    bench.run(first, until=lambda: law.lost)
    bench.run(first, until=steps_after(law))
    place = law.in_flight[-1].position[1]
    np.testing.assert_array_equal(checkpoints.kept.lost["a2"], place)
    bench.run(seconds=10.0)  # the first is dead
    successor = SharingLaw(mission)
    second = bench.controller(successor, epoch=2, identity="second", resume=checkpoints.kept)
    assert second.supervisor.lost == ["a2"]
    bench.run(second, until=lambda: len(successor.in_flight) >= 2)
    assert successor.lost == [[False, True]]
    np.testing.assert_array_equal(successor.in_flight[-1].position[1], place)
