"""Agents die, fall silent and come back in flight; the others go on, and are told so."""

from itertools import pairwise

import numpy as np
import pytest
from service_fakes import Bench, SharingBrain, SweepLaw, small_mission
from test_controller import CheckpointStore

from mpc_cover.service.agent.schedule import Plant, Schedule, predict
from mpc_cover.service.protocol.decoding import Reason, decode_plan, decode_status
from mpc_cover.service.protocol.messages import Phase


@pytest.fixture
def law(mission):
    return SharingBrain(mission)


@pytest.fixture
def fleet(bench):
    return [bench.agent("a1"), bench.agent("a2")]


@pytest.fixture
def controller(bench, fleet, law):
    controller = bench.controller(law)
    bench.run(controller, until=lambda: len(law.predicted) >= 3)
    return controller


def steps_after(law):
    """Return a condition: two more steps were made."""
    count = len(law.predicted)
    return lambda: len(law.predicted) >= count + 2


def test_a_dead_agent_is_lost_within_two_periods_and_the_others_fly_on(bench, fleet, law, controller):
    died_s = bench.clock.now()
    bench.kill(fleet[1])
    bench.run(controller, until=lambda: law.lost)
    assert bench.clock.now() - died_s <= 1.0 + 1e-6
    assert law.lost == [[False, True]]
    assert "controller: a2 is lost: its work is shared out" in bench.said
    assert controller.phase is Phase.FLYING
    assert controller.supervisor.lost == ["a2"]
    before = fleet[0].schedule.flown.ref.seq
    bench.run(controller, until=steps_after(law))
    assert fleet[0].schedule.flown.ref.seq > before
    assert decode_status(bench.hear(bench.keys.status).drain()[-1].payload).lost == ["a2"]


@pytest.mark.parametrize("later_s", [0.0, 0.1, 0.2, 0.3, 0.4])
def test_it_is_given_to_the_brain_where_its_deadman_stops_it(bench, fleet, law, controller, later_s):
    bench.run(controller, until=lambda: np.linalg.norm(fleet[1].plant.velocity) > 0.5)
    bench.run(controller, seconds=later_s)  # at any phase of the controller's period
    bench.kill(fleet[1])
    last = fleet[1].plant
    bench.run(controller, until=lambda: law.lost)
    bench.run(controller, until=steps_after(law))
    stop, _ = predict(Plant(last.time_s, last.position, last.velocity), Schedule(1.0), last.time_s + 9.0)
    for position, velocity in law.predicted[-2:]:
        np.testing.assert_allclose(position[1], stop, atol=1e-9)
        assert not velocity[1].any()


@pytest.mark.parametrize("state_period_s", [0.2, 0.25, 0.5])
def test_its_last_words_do_not_make_it_fly_on(state_period_s):
    bench = Bench(small_mission(8.0, state_period_s=state_period_s))
    law, fleet = SharingBrain(bench.mission, 7.0), [bench.agent("a1"), bench.agent("a2")]
    controller = bench.controller(law)
    bench.run(controller, until=lambda: np.linalg.norm(fleet[1].plant.velocity) > 0.5)
    bench.kill(fleet[1])
    last = fleet[1].plant
    bench.run(controller, until=lambda: law.lost)
    stop, _ = predict(Plant(last.time_s, last.position, last.velocity), Schedule(1.0), last.time_s + 9.0)
    before = len(law.predicted)
    bench.run(controller, until=lambda: len(law.predicted) >= before + 3)
    for position, _ in law.predicted[before:]:
        np.testing.assert_allclose(position[1], stop, atol=1e-9)


def test_nothing_more_is_sent_to_it(bench, fleet, law, controller):
    bench.kill(fleet[1])
    bench.run(controller, until=lambda: law.lost)
    inbox = bench.bus.join().inbox(bench.keys.plan("a2"), 100)
    bench.run(controller, until=steps_after(law))
    assert not inbox.drain()


def test_a_hung_agent_is_lost_after_half_a_horizon_and_flies_its_plan_to_the_end(bench, fleet, law, controller):
    hung = fleet[1]
    bench.agents.remove(hung)  # its token stays
    silent_s, last = bench.clock.now(), hung.schedule
    bench.run(controller, until=lambda: law.lost, seconds=10.0)
    assert 2.0 < bench.clock.now() - silent_s <= 3.0
    bench.run(controller, until=steps_after(law))
    position, velocity = law.predicted[-1]
    known = last.queue[-1] if last.queue else last.flown
    np.testing.assert_allclose(position[1], known.motion.position[-1], atol=1e-9)
    assert not velocity[1].any()


def test_a_broken_line_is_told_from_a_death_by_the_silence_before(bench, fleet, law, controller):
    """The token of a process that is out of reach goes with the lease, a second after its last word."""
    cut = fleet[1]
    bench.agents.remove(cut)
    bench.run(controller, seconds=1.1)
    assert not law.lost
    bench.transports["a2"].close()
    bench.run(controller, until=lambda: law.lost)
    bench.run(controller, until=steps_after(law))
    known = cut.schedule.queue[-1] if cut.schedule.queue else cut.schedule.flown
    np.testing.assert_allclose(law.predicted[-1][0][1], known.motion.position[-1], atol=1e-9)


def test_whoever_comes_back_shares_the_work_once_at_rest(bench, fleet, law, controller):
    absent = fleet[1]
    bench.agents.remove(absent)
    bench.run(controller, until=lambda: law.lost, seconds=10.0)
    bench.agents.append(absent)
    bench.run(controller, until=lambda: len(law.lost) > 1, seconds=10.0)
    assert absent.at_rest
    assert law.lost == [[False, True], [False, False]]
    assert "controller: a2 is back: work is shared with it again" in bench.said
    bench.run(controller, until=steps_after(law))
    np.testing.assert_allclose(law.predicted[-1][0][1], absent.plant.position, atol=0.5)
    assert set(absent.rejected) <= {Reason.EXPIRED}  # what was sent while it hung
    assert absent.schedule.flown.ref.seq > 5


def test_one_that_starts_anew_is_lost_and_back_in_two_steps(bench, fleet, law, controller):
    bench.kill(fleet[1])
    anew = bench.agent("a2", instance="another-life")
    bench.run(controller, until=lambda: len(law.lost) > 1, seconds=3.0)
    assert law.lost == [[False, True], [False, False]]
    bench.run(controller, until=lambda: anew.schedule.flown is not None, seconds=3.0)
    assert controller.phase is Phase.FLYING
    assert anew.rejected == {Reason.WRONG_INSTANCE: 1}  # the last plan for the one before


def test_when_nobody_is_left_it_waits_for_everyone(bench, fleet, law, controller):
    for agent in list(bench.agents):
        bench.kill(agent)
    bench.run(controller, seconds=3.0)
    assert controller.phase is Phase.WAITING
    assert controller.heartbeat.text == "a1 is not here; a2 is not here"
    assert controller.supervisor.lost == []


def test_before_the_first_take_off_it_waits_for_everyone(bench, law):
    fleet = [bench.agent("a1"), bench.agent("a2")]
    controller = bench.controller(law)
    bench.kill(fleet[1])
    bench.run(controller, seconds=5.0)
    assert controller.phase is Phase.WAITING
    assert controller.heartbeat.text == "a2 is not here"
    assert not law.lost


def test_a_pause_ends_without_the_lost(bench, fleet, law, controller):
    bench.kill(fleet[1])
    bench.run(controller, until=lambda: law.lost)
    controller._regroup("a reason")
    bench.run(controller, until=lambda: controller.phase is Phase.FLYING, seconds=10.0)
    kinds = [kind for kind, _, _ in law.calls]
    assert kinds.count("prepare") == 2
    assert controller.supervisor.lost == ["a2"]


def test_the_mission_is_complete_without_the_lost(bench, fleet, law, controller):
    bench.kill(fleet[1])
    bench.run(controller, until=lambda: law.lost)
    law.coverage.first[:] = np.minimum(law.coverage.first, controller.mission_time_s)  # someone saw the rest
    bench.run(controller, until=lambda: controller.done, seconds=20.0)
    assert controller.exit_status == 0
    assert controller.heartbeat.text == "everything is covered, and everyone but a2 is at rest"
    assert fleet[0].at_rest


def test_a_controller_that_was_asleep_does_not_think_that_others_were(bench, fleet, law, controller):
    bench.bus.channel = lambda key, payload: [] if key.endswith("/state") else [payload]
    bench.run(seconds=3.5)  # stopped: nothing reached it
    bench.bus.channel = None
    controller.tick()
    assert controller.phase is Phase.FLYING
    bench.run(controller, seconds=1.0)
    assert not law.lost


def test_a_brain_that_cannot_share_makes_everyone_wait(bench, fleet):
    law = SweepLaw(bench.mission)
    controller = bench.controller(law)
    bench.run(controller, until=lambda: len(law.predicted) >= 3)
    bench.kill(fleet[1])
    bench.run(controller, until=lambda: controller.phase is Phase.WAITING, seconds=5.0)
    assert "a2 not heard for 2 s: everyone finishes its plan and waits" in " ".join(bench.said)


def test_a_successor_knows_who_was_lost_and_where(bench, fleet, mission):
    law, checkpoints = SharingBrain(mission), CheckpointStore()
    first = bench.controller(law, checkpoints=checkpoints)
    bench.run(first, until=lambda: len(law.predicted) >= 3)
    bench.kill(fleet[1])
    bench.run(first, until=lambda: law.lost)
    bench.run(first, until=steps_after(law))
    place = law.predicted[-1][0][1]
    np.testing.assert_array_equal(checkpoints.kept.lost["a2"], place)
    bench.run(seconds=10.0)  # the first is dead
    successor = SharingBrain(mission)
    second = bench.controller(successor, epoch=2, identity="second", resume=checkpoints.kept)
    assert successor.lost == [[False, True]]
    bench.run(second, until=lambda: len(successor.predicted) >= 2)
    np.testing.assert_array_equal(successor.predicted[-1][0][1], place)


def test_its_plans_are_numbered_on(bench, fleet, law, controller):
    """Whoever stays sees no gap and no repeat in its plans when another is lost."""
    inbox = bench.hear(bench.keys.plan("a1"))
    bench.kill(fleet[1])
    bench.run(controller, until=lambda: law.lost)
    bench.run(controller, until=steps_after(law))
    numbers = [decode_plan(item.payload, 2).seq for item in inbox.drain()]
    assert all(later == former + 1 for former, later in pairwise(numbers))


def test_silence_counts_from_what_a_delay_allows(mission):
    bench = Bench(small_mission(disturbance={"delay_s": 0.5}))
    law = SharingBrain(bench.mission)
    for name in ("a1", "a2"):
        bench.agent(name)
    controller = bench.controller(law)
    bench.run(controller, until=lambda: controller.done)
    assert controller.exit_status == 0
    assert not law.lost
