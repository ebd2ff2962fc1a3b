"""A controller's epoch is never one that agents reject for ever, and nobody drives epochs to their end."""

import pytest
from service_fakes import Bench, straight_plan
from sweep_laws import StraightSweepLaw

from mpc_cover.service.controller.epochs import believed_epochs
from mpc_cover.service.protocol import bus
from mpc_cover.service.protocol.messages import Phase, State, encode


def flown_before(bench, fleet, *, epoch, controller="before"):
    """Let all agents fly and finish a plan of an earlier controller, which is gone."""
    sender = bench.bus.join()
    for agent in fleet:
        plan = straight_plan(agent, bench.clock.now() + 0.5, epoch=epoch, controller=controller)
        sender.publisher(bench.keys.plan(agent.id), bus.PLAN).publish(encode(plan))
    bench.run(seconds=6.0)
    sender.close()
    assert all(agent.at_rest for agent in fleet)
    bench.plans("a1"), bench.plans("a2")


def over(controller):
    return lambda: controller.done


@pytest.mark.parametrize("epoch", [7, 900_000])
def test_a_new_machine_goes_on_after_the_epoch_that_agents_have_seen(bench, fleet, law, epoch):
    flown_before(bench, fleet, epoch=epoch)
    kept = []
    controller = bench.controller(law, epoch=1, identity="new", keep_epoch=kept.append)
    bench.run(controller, until=over(controller))
    assert controller.exit_status == 0
    assert kept == [epoch + 1]
    assert {plan.epoch for plan in bench.plans("a1")} == {epoch + 1}
    assert {status.epoch for status in bench.statuses()} <= {1, epoch + 1}
    assert not any(agent.rejected for agent in fleet)
    assert f"agents have seen epoch {epoch}, and no other controller is here" in " ".join(bench.said)


def test_so_does_the_twin_of_a_controller_that_is_gone(bench, fleet, law):
    """Two machines without a common state directory: both are epoch 1."""
    flown_before(bench, fleet, epoch=1, controller="twin")
    controller = bench.controller(law, epoch=1, identity="new")
    bench.run(controller, until=over(controller))
    assert controller.exit_status == 0
    assert {plan.epoch for plan in bench.plans("a1")} == {2}


def test_it_takes_over_from_one_that_died_while_agents_still_fly_its_plan(bench, fleet, law):
    old = bench.controller(StraightSweepLaw(bench.mission, goal_y=2.0), epoch=5, identity="old")
    bench.run(old, until=lambda: old.phase is Phase.FLYING)
    bench.run(old, seconds=1.2)
    old._transport.close()
    assert not all(agent.at_rest for agent in fleet)
    new = bench.controller(law, epoch=1, identity="new")
    bench.run(new, until=over(new))
    assert new.exit_status == 0
    assert all(agent.schedule.flown.ref.epoch == 6 for agent in fleet)


def test_it_withdraws_before_one_that_is_there(bench, fleet, law):
    old = bench.controller(StraightSweepLaw(bench.mission), epoch=5, identity="old")
    bench.run(old, until=lambda: old.phase is Phase.FLYING)
    bench.run(old, seconds=1.2)
    new = bench.controller(law, epoch=1, identity="new")
    bench.run(old, new, until=lambda: old.done and new.done)
    assert (old.exit_status, new.exit_status) == (0, 1)
    assert "a controller of epoch 5 has taken over from this one, of epoch 1" in " ".join(bench.said)


def test_one_that_was_stopped_withdraws_though_its_successor_has_come_and_gone(bench, fleet):
    """It does not fly the mission once more."""
    old = bench.controller(StraightSweepLaw(bench.mission, goal_y=2.0), epoch=1, identity="old")
    bench.run(old, until=lambda: old.phase is Phase.FLYING)
    bench.run(old, seconds=1.2)
    new = bench.controller(StraightSweepLaw(bench.mission), epoch=2, identity="new")
    bench.run(new, until=over(new))
    new._transport.close()
    bench.run(old, until=over(old))
    assert (new.exit_status, old.exit_status) == (0, 1)
    assert all(agent.schedule.flown.ref.epoch == 2 for agent in fleet)


def test_the_word_of_one_agent_does_not_drive_epochs_to_their_end(bench, fleet, law):
    """It is told who is to be restarted; then all goes on."""
    flown_before(bench, fleet[:1], epoch=2**50)
    controller = bench.controller(law, epoch=1)
    bench.run(controller, seconds=5.0)
    assert controller.phase is Phase.WAITING
    assert f"a1 says that it has seen epoch {2**50}, as nobody else has: restart it" in bench.statuses()[-1].text
    assert bench.plans("a2") == []
    bench.kill(fleet[0])
    bench.agent("a1", instance="a1-again", place=fleet[0].plant.position)
    bench.run(controller, until=over(controller))
    assert controller.exit_status == 0


def test_an_agent_turns_a_plan_away_that_is_too_far_ahead(bench):
    agent = bench.agent("a1")
    sender = bench.bus.join().publisher(bench.keys.plan("a1"), bus.PLAN)
    sender.publish(encode(straight_plan(agent, 100.5, epoch=3)))
    bench.run(seconds=6.0)
    sender.publish(encode(straight_plan(agent, bench.clock.now() + 0.5, epoch=2**53)))
    bench.run(seconds=0.5)
    assert agent.rejected == {"epoch too far ahead": 1}
    assert bench.states("a1")[-1].epoch == 3


def test_states_of_an_earlier_version_say_nothing_of_epochs():
    told = State(agent="a1", instance="i", seq=0, time_s=0.0, position=[0.0], velocity=[0.0])
    assert (told.epoch, told.controller) == (0, "")


@pytest.mark.parametrize(
    ("seen", "believed"),
    [
        ({"a1": 0, "a2": 9}, {"a1", "a2"}),
        ({"a1": 1_000_003, "a2": 2}, {"a2"}),
        ({"a1": 1_000_003, "a2": 3}, {"a1", "a2"}),
        ({"a1": 10**9, "a2": 10**9, "a3": 0}, {"a1", "a2", "a3"}),
        ({"a1": 2**53, "a2": 2**53}, set()),
        ({"a1": 10**7}, set()),
    ],
)
def test_a_jump_is_believed_from_two_agents_at_least(seen, believed):
    assert believed_epochs(seen, own=2) == believed


def test_when_its_epoch_cannot_be_kept_it_says_so_and_goes_on(bench, fleet, law):
    def full(epoch):
        raise OSError(28, "No space left on device")

    flown_before(bench, fleet, epoch=7)
    controller = bench.controller(law, epoch=1, keep_epoch=full)
    bench.run(controller, until=over(controller))
    assert controller.exit_status == 0
    assert "epoch 8 cannot be written: No space left on device" in " ".join(bench.said)


def test_a_crowd_is_asked_by_ids_not_by_the_order_of_their_words(mission):
    bench = Bench(mission)
    fleet = [bench.agent("a2"), bench.agent("a1")]
    flown_before(bench, fleet, epoch=7)
    controller = bench.controller(StraightSweepLaw(mission), epoch=1)
    bench.run(controller, until=over(controller))
    assert controller.exit_status == 0
