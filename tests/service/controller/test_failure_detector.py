"""Who is lost: told from a death, a hang, a broken line, or a new life; and who is back."""

import numpy as np
import pytest
from service_fakes import Bench, small_mission
from sweep_laws import SharingLaw

from mpc_cover.service.agent.schedule import Plant, Schedule, predict
from mpc_cover.service.protocol.decoding import Reason
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
    assert bench.statuses()[-1].lost == ["a2"]


@pytest.mark.parametrize("state_period_s", [0.2, 0.25, 0.5])
def test_its_last_words_do_not_make_it_fly_on(state_period_s):
    bench = Bench(small_mission(8.0, state_period_s=state_period_s))
    bench.hear(bench.keys.state("a2"))
    law, fleet = SharingLaw(bench.mission, 7.0), [bench.agent("a1"), bench.agent("a2")]
    controller = bench.controller(law)
    bench.run(controller, until=lambda: np.linalg.norm(fleet[1].plant.velocity) > 0.5)
    bench.kill(fleet[1])
    last = bench.states("a2")[-1]
    bench.run(controller, until=lambda: law.lost)
    stop, _ = predict(
        Plant(last.time_s, np.array(last.position), np.array(last.velocity)), Schedule(1.0), last.time_s + 9.0
    )
    before = len(law.in_flight)
    bench.run(controller, until=lambda: len(law.in_flight) >= before + 3)
    for state in law.in_flight[before:]:
        np.testing.assert_allclose(state.position[1], stop, atol=1e-9)


def test_a_hung_agent_is_lost_after_half_a_horizon_and_flies_its_plan_to_the_end(bench, fleet, law, controller):
    hung = fleet[1]
    bench.agents.remove(hung)  # its token stays
    silent_s, last = bench.clock.now(), hung.schedule
    bench.run(controller, until=lambda: law.lost, seconds=10.0)
    assert 2.0 < bench.clock.now() - silent_s <= 3.0
    bench.run(controller, until=steps_after(law))
    known, state = last.queue[-1] if last.queue else last.flown, law.in_flight[-1]
    np.testing.assert_allclose(state.position[1], known.motion.position[-1], atol=1e-9)
    assert not state.velocity[1].any()


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
    np.testing.assert_allclose(law.in_flight[-1].position[1], known.motion.position[-1], atol=1e-9)


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
    np.testing.assert_allclose(law.in_flight[-1].position[1], absent.plant.position, atol=0.5)
    assert set(absent.rejected) <= {Reason.EXPIRED}  # what was sent while it hung
    assert absent.schedule.flown.ref.seq > 5
    assert "flies an unknown plan" not in " ".join(bench.said)  # the rest of the one that it had is known


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


def test_before_the_first_take_off_it_waits_for_everyone(bench, fleet, law):
    controller = bench.controller(law)
    bench.kill(fleet[1])
    bench.run(controller, seconds=5.0)
    assert controller.phase is Phase.WAITING
    assert controller.heartbeat.text == "a2 is not here"
    assert not law.lost


def test_silence_counts_from_what_a_delay_allows():
    bench = Bench(small_mission(disturbance={"delay_s": 0.5}))
    law = SharingLaw(bench.mission)
    for name in ("a1", "a2"):
        bench.agent(name)
    controller = bench.controller(law)
    bench.run(controller, until=lambda: controller.done)
    assert controller.exit_status == 0
    assert law.states
    assert not law.lost
