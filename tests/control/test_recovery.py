"""What is done when all is not well: every transition between the modes, and that thorough planning ends some day."""

from __future__ import annotations

from dataclasses import fields, replace
from itertools import product

import numpy as np
import pytest
from closed_loop import at_start, small_mission
from hypothesis import given
from hypothesis import strategies as st

from mpc_cover.control.receding_horizon import RecedingHorizon
from mpc_cover.control.recovery import Mode, ReplanHistory, Situation, next_mode, stays_at
from mpc_cover.information.build import make_map
from mpc_cover.planning.budget import Budget
from mpc_cover.planning.candidate import evaluate_guess
from mpc_cover.planning.initial_guess.guess import rest_guess
from mpc_cover.planning.planner import Planner

NAMES = [field.name for field in fields(Situation)]
CASES = [
    (mode, Situation(**dict(zip(NAMES, values, strict=True))))
    for mode in Mode
    for values in product((False, True), repeat=len(NAMES))
]
"""Every mode in every situation."""


def goes_through(mode, situation):
    """Return whether a fleet that is safe is on its way to rest, to be planned for there."""
    return situation.safe and mode is Mode.REPLAN_AT_REST and not situation.settled


def left_to(wanted):
    """Return the cases that no rule of higher rank decides, as (mode, situation, what comes next)."""
    decided = {Mode.RENDEZVOUS: {Mode.BRAKE, Mode.STOP}, Mode.REPLAN_AT_REST: {Mode.BRAKE, Mode.STOP, Mode.RENDEZVOUS}}
    found = [(mode, s, next_mode(mode, s)) for mode, s in CASES if not goes_through(mode, s)]
    return [case for case in found if case[2] not in decided[wanted]]


# rules, each for itself


def test_it_brakes_exactly_where_nothing_safe_can_be_sent():
    assert all((next_mode(mode, s) is Mode.BRAKE) == (not s.safe) for mode, s in CASES)


def test_coming_to_rest_for_a_plan_is_gone_through_with_until_everyone_has_settled():
    assert all(next_mode(mode, s) is Mode.REPLAN_AT_REST for mode, s in CASES if goes_through(mode, s))


def test_it_stops_exactly_where_nothing_is_left_and_nobody_in_flight_has_lost_touch():
    for mode, s in CASES:
        if s.safe and not goes_through(mode, s):
            over = not s.work_left and not (s.disconnected_by_loss and not s.settled)
            assert (next_mode(mode, s) is Mode.STOP) == over


def test_those_who_may_lose_each_other_meet_before_the_mission_goes_on():
    for mode, s, after in left_to(Mode.RENDEZVOUS):
        no_way_within_range = s.no_plan_found and s.range_infeasible
        flies_apart = s.disconnected and not (s.on_plan and mode is not Mode.RENDEZVOUS)
        assert (after is Mode.RENDEZVOUS) == (s.rendezvous_possible and (no_way_within_range or flies_apart))


def test_it_comes_to_rest_for_a_plan_exactly_where_that_promises_more():
    for _, s, after in left_to(Mode.REPLAN_AT_REST):
        assert after is (Mode.REPLAN_AT_REST if s.worth_replanning else Mode.NOMINAL)


def test_who_cannot_meet_does_not_try():
    assert all(next_mode(mode, replace(s, rendezvous_possible=False)) is not Mode.RENDEZVOUS for mode, s in CASES)


def test_a_meeting_that_has_begun_goes_on_until_nobody_is_apart():
    for mode, s in CASES:
        if mode is Mode.RENDEZVOUS and s.safe and s.rendezvous_possible and s.work_left:
            assert next_mode(mode, s) is Mode.RENDEZVOUS or not s.disconnected


def test_only_a_meeting_and_a_way_to_rest_are_remembered():
    """From any other mode the situation alone decides."""
    for situation in {s for _, s in CASES}:
        assert len({next_mode(mode, situation) for mode in (Mode.NOMINAL, Mode.STOP, Mode.BRAKE)}) == 1


def test_without_news_a_mode_stays():
    """Asking again in the same situation changes nothing: no mode flickers while nothing happens."""
    for mode, situation in CASES:
        after = next_mode(mode, situation)
        again = next_mode(after, situation)
        # a meeting is gone through with, even on a plan, once it has begun
        assert again is after or (again is Mode.RENDEZVOUS and situation.disconnected)


# the transitions by name

WELL = Situation()
TRANSITIONS = [
    ("a mission goes on", Mode.NOMINAL, WELL, Mode.NOMINAL),
    ("all is covered", Mode.NOMINAL, replace(WELL, work_left=False), Mode.STOP),
    ("something is owed again", Mode.STOP, WELL, Mode.NOMINAL),
    ("no plan passes", Mode.NOMINAL, replace(WELL, safe=False), Mode.BRAKE),
    ("a plan passes again", Mode.BRAKE, WELL, Mode.NOMINAL),
    ("a relay is lost", Mode.NOMINAL, replace(WELL, disconnected=True, disconnected_by_loss=True), Mode.RENDEZVOUS),
    ("on a plan that keeps the range", Mode.NOMINAL, replace(WELL, disconnected=True, on_plan=True), Mode.NOMINAL),
    ("they are still apart", Mode.RENDEZVOUS, replace(WELL, disconnected=True, on_plan=True), Mode.RENDEZVOUS),
    ("they have met", Mode.RENDEZVOUS, WELL, Mode.NOMINAL),
    ("they have met, and all is covered", Mode.RENDEZVOUS, replace(WELL, work_left=False), Mode.STOP),
    (
        "all is covered, but some are out of range",
        Mode.NOMINAL,
        replace(WELL, work_left=False, disconnected=True, disconnected_by_loss=True),
        Mode.RENDEZVOUS,
    ),
    (
        "all is covered, some are out of range, and everyone rests",
        Mode.RENDEZVOUS,
        replace(WELL, work_left=False, disconnected=True, disconnected_by_loss=True, settled=True),
        Mode.STOP,
    ),
    (
        "nobody can meet",
        Mode.RENDEZVOUS,
        replace(WELL, disconnected=True, rendezvous_possible=False),
        Mode.NOMINAL,
    ),
    (
        "range infeasible, without a plan",
        Mode.NOMINAL,
        replace(WELL, range_infeasible=True, no_plan_found=True),
        Mode.RENDEZVOUS,
    ),
    ("range infeasible, on a plan", Mode.NOMINAL, replace(WELL, range_infeasible=True, on_plan=True), Mode.NOMINAL),
    ("steps are too short", Mode.NOMINAL, replace(WELL, worth_replanning=True), Mode.REPLAN_AT_REST),
    ("still moving", Mode.REPLAN_AT_REST, WELL, Mode.REPLAN_AT_REST),
    ("all is covered on the way to rest", Mode.REPLAN_AT_REST, replace(WELL, work_left=False), Mode.REPLAN_AT_REST),
    ("at rest, a plan is found", Mode.REPLAN_AT_REST, replace(WELL, settled=True, on_plan=True), Mode.NOMINAL),
    (
        "at rest, planning was too short",
        Mode.REPLAN_AT_REST,
        replace(WELL, settled=True, worth_replanning=True),
        Mode.REPLAN_AT_REST,
    ),
    ("nothing passes on the way to rest", Mode.REPLAN_AT_REST, replace(WELL, safe=False), Mode.BRAKE),
    ("at rest, all is covered", Mode.REPLAN_AT_REST, replace(WELL, settled=True, work_left=False), Mode.STOP),
]


@pytest.mark.parametrize(
    ("mode", "situation", "expected"), [case[1:] for case in TRANSITIONS], ids=[c[0] for c in TRANSITIONS]
)
def test_named_transitions(mode, situation, expected):
    assert next_mode(mode, situation) is expected


# thorough planning ends

planning = st.floats(0.05, 60.0)


@given(planning, st.lists(st.sampled_from(Mode), max_size=12))
def test_patience_doubles_with_every_planning_in_vain_and_begins_anew_after_one_that_was_not(planning_s, ends):
    history = ReplanHistory(planning_s)
    for mode in ends:
        before, history = history, history.after(mode)
        assert history.time_factor == (2.0 * before.time_factor if mode is Mode.REPLAN_AT_REST else 1.0)


@given(planning)
def test_poor_plans_are_planned_again_three_times_or_until_planning_is_long(planning_s):
    history, nothing = ReplanHistory(planning_s), np.ones((1, 10))
    longest = planning_s
    while history.is_poor(nothing, nothing):
        longest = planning_s * history.time_factor
        history = history.after(Mode.REPLAN_AT_REST)
    assert history.failed_attempts >= 3
    assert history.failed_attempts == 3 or 8.0 <= 2.0 * longest < 32.0


@given(st.integers(1, 40), st.data())
def test_a_plan_is_poor_if_it_leaves_more_than_half_of_what_is_owed(owed, data):
    left = data.draw(st.integers(0, owed))
    weights = [np.where(np.arange(40) < count, 1.0, 0.0)[None] for count in (left, owed)]
    assert ReplanHistory(1.0).is_poor(*weights) == (left > 0.5 * owed)


@given(st.lists(st.tuples(st.integers(0, 2), st.integers(1, 5)), max_size=30))
def test_a_fleet_is_stranded_at_a_place_again_only_when_less_is_owed(visits):
    history, last = ReplanHistory(1.0), None
    for place, owed in visits:
        here = np.full((2, 2), float(place))
        stranded, history = history.stranded(here, float(owed))
        assert stranded == (last is None or last[0] != place or owed < last[1])
        if stranded:
            last = place, owed
    stays = ReplanHistory(1.0)
    count = 0
    for _, owed in visits:
        stranded, stays = stays.stranded(np.zeros((2, 2)), float(owed))
        count += stranded
    assert count <= 5, "at one place no oftener than what is owed can become less"


def test_a_fleet_stays_where_it_moves_less_than_a_millimetre():
    here = np.zeros((2, 2))
    assert stays_at(np.full((3, 2, 2), 0.9e-3), here)
    assert not stays_at(here + np.array([[[0.0, 0.0], [0.0, 0.0]], [[0.0, 0.0], [0.0, 1.1e-3]]]), here)


# the same, by the law


class Resting(Planner):
    """Stays at rest for the first plannings, and notes how much work each may take [s]."""

    def __init__(self, resting):
        super().__init__("piqp")
        self.resting, self.asked = resting, []

    def thorough(self, task, budget):
        self.asked.append(budget.left_s)
        if len(self.asked) > self.resting:
            return super().thorough(task, Budget.counted(0.5))
        still = rest_guess(task.position)
        return evaluate_guess(task, still, task.least_steps)


def thoughts(mission, planner, count):
    """Return after each thorough planning at the start whether one more is asked for."""
    law, found = RecedingHorizon(mission, planner=planner), []
    for _ in range(count):
        budget = Budget.counted(mission.spec.control.planning_time_s)
        law.published(law.step(at_start(mission), make_map(mission), budget).trajectory)
        found.append(law.mode is Mode.REPLAN_AT_REST)
    return found


def test_planning_that_was_too_short_is_thought_over_for_twice_as_long():
    """A first plan that stays at rest would be flown for ever; the fleet is at rest anyway."""
    mission, planner = small_mission(), Resting(2)
    assert thoughts(mission, planner, 3) == [True, True, False]
    planning_s = mission.spec.control.planning_time_s
    assert planner.asked == [planning_s, 2 * planning_s, 4 * planning_s]


def test_thinking_in_vain_ends():
    assert thoughts(small_mission(), Resting(9), 4) == [True, True, True, False]
