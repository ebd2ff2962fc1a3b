"""A step within its budget: what comes too late is not sent, and the law is told of what was sent alone."""

import numpy as np
import pytest
from service_fakes import Bench, small_mission
from sweep_laws import FaultyLaw, SlowLaw, StraightSweepLaw

from mpc_cover.planning.budget import Budget
from mpc_cover.service.protocol.messages import Phase

LATE_S, JUST_IN_TIME_S = 0.45, 0.35
"""A plan must be out a state period, 0.1 s, before its start, a period of 0.5 s after the tick."""


def slow_flight(bench, takes_s, slow):
    """Return a law that was asked for six plans in flight, some of them slow, and its controller."""
    law = SlowLaw(bench.mission, bench.clock, takes_s, slow)
    controller = bench.controller(law, budget_of=Budget.wall_clock)
    bench.run(controller, until=lambda: len(law.in_flight) >= 6)
    return law, controller


def test_a_plan_that_comes_too_late_is_not_sent_and_nobody_has_to_refuse_one(bench, fleet):
    law, controller = slow_flight(bench, LATE_S, range(3, 100))
    assert len(bench.plans()) == 1 + 3  # the first plan, and those of the steps in time
    assert len(law.sent) == 1 + 3
    assert controller.step_log.misses >= 2
    assert any("is not sent" in said for said in bench.said)
    assert not fleet[0].rejected
    assert not fleet[1].rejected


def test_one_that_is_just_in_time_is(bench, fleet):
    law, _ = slow_flight(bench, JUST_IN_TIME_S, range(3, 100))
    assert len(bench.plans()) == len(law.sent) == 1 + 6


def test_after_a_late_plan_the_next_step_starts_on_the_one_that_is_flown(fleet, bench):
    law, controller = slow_flight(bench, LATE_S, {3})
    late, after = law.in_flight[3:5]
    flown = law.sent[3]  # that of the step before the late one
    assert flown.start_time == pytest.approx(late.time - 0.5)
    for state in (late, after):
        np.testing.assert_allclose(np.array(flown.at(state.time)), [state.position, state.velocity], atol=1e-9)
    assert [sent.start_time for sent in law.sent[3:5]] == [flown.start_time, after.time]
    assert controller.step_log.misses >= 1
    assert not any(agent.rejected for agent in fleet)


def faulty_now_and_then(mission):
    """Return a law that proposes a collision every third time."""
    law = FaultyLaw(mission, "a collision", goal_y=8.5)
    good, faulty = StraightSweepLaw.step, FaultyLaw.step
    law.step = lambda *given: (faulty if len(law.states) % 3 == 2 else good)(law, *given)
    return law


@pytest.mark.parametrize("kind", ["in time", "late now and then", "refused now and then"])
def test_a_law_is_told_of_exactly_what_was_sent(kind):
    bench = Bench(small_mission(height=9.0))
    fleet = [bench.agent("a1"), bench.agent("a2")]
    law = {
        "in time": lambda: StraightSweepLaw(bench.mission, goal_y=8.5),
        "late now and then": lambda: SlowLaw(bench.mission, bench.clock, LATE_S, {2, 5, 6}),
        "refused now and then": lambda: faulty_now_and_then(bench.mission),
    }[kind]()
    controller = bench.controller(law, budget_of=Budget.wall_clock)
    bench.run(controller, until=lambda: len(law.in_flight) >= 9)
    seen = list(zip(bench.plans("a1"), bench.plans("a2"), strict=True))
    assert len(seen) == len(law.sent)
    assert (len(law.sent) < len(law.states)) == (kind != "in time")
    for plans, sent in zip(seen, law.sent, strict=True):
        for name in ("position", "velocity", "input"):
            np.testing.assert_array_equal(np.stack([getattr(plan, name) for plan in plans], 1), getattr(sent, name))
        assert plans[0].start_s - seen[0][0].start_s == pytest.approx(sent.start_time - law.sent[0].start_time)
    assert not any(agent.rejected for agent in fleet)


@pytest.mark.parametrize("returned", [None, 3, "a plan"])
def test_what_is_no_proposal_is_a_failed_step(bench, fleet, returned):
    law = StraightSweepLaw(bench.mission)
    good, told = law.step, "must be a Proposal"

    def refused():
        return [said for said in bench.said if told in said]

    law.step = lambda *given: returned if len(law.sent) == 3 and not refused() else good(*given)
    controller = bench.controller(law)
    bench.run(controller)
    assert controller.phase is Phase.COMPLETE
    assert len(refused()) == 1
    assert not any(agent.rejected for agent in fleet)


class DeafLaw(StraightSweepLaw):
    """Fails once, on hearing what was sent."""

    def published(self, trajectory):
        if len(self.sent) == 3:
            self.sent.append(trajectory)
            raise RuntimeError("deaf")
        super().published(trajectory)


def test_a_law_that_fails_on_hearing_what_was_sent_is_a_failed_step_and_the_flight_goes_on(bench, fleet):
    law = DeafLaw(bench.mission)
    controller = bench.controller(law)
    bench.run(controller)
    assert controller.phase is Phase.COMPLETE
    assert sum("failed on hearing what was sent: RuntimeError('deaf')" in said for said in bench.said) == 1
    assert not any(agent.rejected for agent in fleet)


def test_a_plan_has_the_planning_time_at_rest_and_its_part_of_a_period_in_flight(bench, fleet, law):
    controller = bench.controller(law)
    bench.run(controller, until=lambda: controller.done)
    control = bench.mission.spec.control
    assert law.budgets_s[0] == control.planning_time_s
    np.testing.assert_allclose(law.budgets_s[1:], control.deadline_fraction * control.period_s, atol=1e-9)


def test_a_step_that_starts_late_has_less_time_and_none_at_all_half_a_budget_late(bench, fleet, law):
    controller = bench.controller(law)
    bench.run(controller, until=lambda: len(law.in_flight) >= 3)
    control = bench.mission.spec.control
    budget_s = control.deadline_fraction * control.period_s
    for part, steps in ((0.3, 1), (0.6, 0)):
        before, skipped = len(law.in_flight), controller.step_log.skipped
        due_s = controller.next_time
        bench.run(seconds=due_s - bench.clock.now() + part * budget_s)  # agents alone
        bench.wait_until(due_s + part * budget_s)
        controller.tick()
        assert len(law.in_flight) == before + steps
        assert controller.step_log.skipped == skipped + 1 - steps
        if steps:
            assert law.budgets_s[-1] == pytest.approx((1.0 - part) * budget_s)


def never_exhausted(_seconds):
    return Budget.unlimited()


@pytest.mark.parametrize("budget_of", [Budget.counted, never_exhausted], ids=["counted", "never exhausted"])
def test_whether_there_is_a_deadline_makes_no_difference_to_who_keeps_it(budget_of):
    """The same states are asked for plans, and the same messages are sent, as on the machine's own clock."""
    flights = []
    for of in (Budget.wall_clock, budget_of):
        bench = Bench(small_mission(disturbance={"position_noise_m": 0.01, "delay_s": 0.2}))
        bench.agent("a1"), bench.agent("a2")
        law = StraightSweepLaw(bench.mission)
        controller = bench.controller(law, budget_of=of)
        bench.run(controller, until=lambda: controller.done)  # noqa: B023 - within the turn
        assert controller.phase is Phase.COMPLETE
        plans = [bench.hear(bench.keys.plan(name)).drain() for name in ("a1", "a2")]
        states = [(state.time, state.position.tobytes(), state.velocity.tobytes()) for state in law.states]
        sources = [(step.kind, step.mission_time_s, step.plan_source) for step in controller.step_log.steps]
        flights.append((plans, states, sources, law.budgets_s))
    (*ours, budgets_s), (*others, counted_s) = flights
    assert ours == others
    assert len(ours[1]) > 5
    assert all(0.0 < left_s <= given_s for left_s, given_s in zip(budgets_s, counted_s, strict=True))


class CountingLaw(StraightSweepLaw):
    """Works for `work_s` on each plan in flight."""

    work_s = 0.0

    def step(self, state, coverage, budget):
        proposal = super().step(state, coverage, budget)
        if not state.settled:
            budget.charge(self.work_s)
            self.left_s = budget.left_s
        return proposal


@pytest.mark.parametrize(("work_s", "missed"), [(0.1, False), (9.0, True)])
def test_more_work_than_was_budgeted_is_a_deadline_missed_on_a_clock_that_counts_work(bench, fleet, work_s, missed):
    """Its plan is not sent then, as on a clock that shows how long it took."""
    law = CountingLaw(bench.mission)
    law.work_s = work_s
    controller = bench.controller(law)
    bench.run(controller, until=lambda: len(law.in_flight) >= 4)
    assert law.left_s == pytest.approx(law.budgets_s[-1] - work_s)
    assert controller.step_log.misses == (4 if missed else 0)
    assert len(law.sent) == 1 + (0 if missed else 4)
