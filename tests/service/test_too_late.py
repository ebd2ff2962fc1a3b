"""Steps that take too long, or are too short for what there is to think about."""

from __future__ import annotations

from threading import Event

from service_fakes import Bench, SharingBrain, SweepLaw, small_mission

from mpc_cover.service.protocol.decoding import decode_plan
from mpc_cover.service.protocol.messages import Phase


class SlowBrain(SweepLaw):
    """Takes `takes_s` of the clock for each step from its fourth on."""

    def __init__(self, mission, clock, takes_s):
        super().__init__(mission)
        self.clock, self.takes_s = clock, takes_s

    def step(self, *state, deadline):
        if len(self.predicted) >= 3:
            self.clock.wait_until(self.clock.now() + self.takes_s, Event())
        return super().step(*state, deadline=deadline)


def test_a_plan_that_comes_too_late_is_not_sent_and_nobody_has_to_refuse_one(bench):
    fleet = [bench.agent("a1"), bench.agent("a2")]
    inbox = bench.hear(bench.keys.plan("a1"))
    law = SlowBrain(bench.mission, bench.clock, takes_s=0.45)
    controller = bench.controller(law, deadlines=True)
    bench.run(controller, until=lambda: len(law.predicted) >= 6)
    assert len(inbox.drain()) == 1 + 3  # the first plan, and those of the steps in time
    assert controller.step_log.misses >= 2
    assert any("is not sent" in said for said in bench.said)
    assert not fleet[0].rejected
    assert not fleet[1].rejected


def test_one_that_is_just_in_time_is(bench):
    bench.agent("a1"), bench.agent("a2")
    inbox = bench.hear(bench.keys.plan("a1"))
    law = SlowBrain(bench.mission, bench.clock, takes_s=0.35)
    controller = bench.controller(law, deadlines=True)
    bench.run(controller, until=lambda: len(law.predicted) >= 6)
    assert len(inbox.drain()) == 1 + 6


class ThoughtfulBrain(SharingBrain):
    """Wants to think in its third step."""

    wants_replan_at_rest = False

    def prepare(self, *state, deadline):
        self.wants_replan_at_rest = False
        return super().prepare(*state, deadline=deadline)

    def step(self, *state, deadline):
        self.wants_replan_at_rest = len(self.predicted) == 2
        return super().step(*state, deadline=deadline)


def test_a_brain_may_stop_everyone_to_think():
    bench = Bench(small_mission(height=9.0, horizon_steps=5))
    bench.agent("a1"), bench.agent("a2")
    inbox = bench.hear(bench.keys.plan("a1"))
    law = ThoughtfulBrain(bench.mission, goal_y=8.5)
    controller = bench.controller(law)
    bench.run(controller, until=lambda: controller.phase is Phase.WAITING and len(law.predicted) == 3)
    assert "a step is too short to plan anew" in " ".join(bench.said)
    bench.run(controller, until=lambda: controller.done)
    assert controller.exit_status == 0
    assert [kind for kind, _, _ in law.calls].count("prepare") == 2
    assert "flies an unknown plan" not in " ".join(bench.said)
    numbers = [decode_plan(item.payload, 2).seq for item in inbox.drain()]
    assert numbers == sorted(set(numbers))
