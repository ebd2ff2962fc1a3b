"""Planted safety bugs, by name, and whether `torture` catches them: a scale for the oracle and the faults.

Each patches what the product has; MPC_COVER_PLANTED_BUG=NAME plants one from here, for a look with a debugger. As a
command: `python tests/service/torture/planted_bugs.py [--seeds 16] [NAME ...]` tells which are caught. A bug is caught
with a violation in a flight in which there is none without it.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from unittest import mock

import numpy as np

from mpc_cover.control import planning_constraints, safety_filter
from mpc_cover.control.safety_filter import SafetyFilter, Verdict
from mpc_cover.information.coverage_map import CoverageMap
from mpc_cover.mission.load import Mission, build_mission
from mpc_cover.service.agent import agent as agent_module
from mpc_cover.service.agent import plan_filter
from mpc_cover.service.agent.agent import Agent
from mpc_cover.service.agent.plan_filter import Authority
from mpc_cover.service.agent.schedule import Plant, Schedule
from mpc_cover.service.controller import control_step, failure_detector
from mpc_cover.service.controller.completion import Completion
from mpc_cover.service.controller.failure_detector import FailureDetector, FailureMode
from mpc_cover.service.controller.fleet_monitor import AgentLink, FleetMonitor
from mpc_cover.service.controller.fleet_supervisor import FleetSupervisor
from mpc_cover.service.controller.mission_clock import MissionClock
from mpc_cover.service.controller.phases import MissionPhases
from mpc_cover.service.controller.plan_publisher import PlanPublisher
from mpc_cover.service.controller.state_prediction import StatePredictor, resting
from mpc_cover.service.protocol.messages import Phase
from mpc_cover.service.torture.drawing import draw
from mpc_cover.service.torture.faults import FaultKind
from mpc_cover.service.torture.world import fly

VARIABLE = "MPC_COVER_PLANTED_BUG"
"""Names the bug to plant in this process; read here and nowhere else."""
SEEDS = 16
"""Flights for each bug; a plain choice."""
LIMIT_S = 90.0
UNCAUGHT_MOST = 3
"""Of the planted bugs that are missed; docs/reliability.md names them."""


def _mission(
    name: str, size: tuple[float, float], starts: list[list[float]], reach: float, radius: float = 0.8
) -> Mission:
    agents = [{"id": f"a{number}", "start_m": at} for number, at in enumerate(starts, 1)]
    raw = {
        "schema": 1,
        "name": name,
        "area": {"shape": {"kind": "box", "min_m": [0.0, 0.0], "max_m": list(size)}, "cell_size_m": 0.5},
        "fleet": {
            "defaults": {"sensing_radius_m": radius, "input_max_m_per_s2": 1.5, "speed_max_m_per_s": 1.5},
            "agents": agents,
            "separation_min_m": 0.5,
            "communication_range_m": reach,
        },
        "control": {"period_s": 0.5, "horizon_steps": 8, "planning_time_s": 0.5},
    }
    return build_mission(raw, name)


MISSION = _mission("tiny-3", (5.0, 5.0), [[0.75, 0.5], [2.25, 0.5], [1.5, 1.5]], 3.0)
"""Three agents in a crowded square: about six seconds of flight."""
TIGHT = _mission("tight-3", (6.0, 6.0), [[0.75, 0.5], [2.25, 0.5], [1.5, 1.5]], 2.0)
"""The same with a range that is used up most of the time."""

CROWD = _mission("crowd-4", (4.0, 4.0), [[0.5, 0.5], [1.5, 0.5], [2.5, 0.5], [1.0, 1.5]], 5.0, radius=0.5)
"""Four agents that meet all the time."""
LONG = _mission("long-3", (9.0, 9.0), [[0.75, 0.5], [2.25, 0.5], [1.5, 1.5]], 4.0)
"""Long enough for another controller to take over."""

Patch = Callable[[], list[mock._patch]]
BUGS: dict[str, tuple[Patch, tuple[FaultKind, ...], Mission]] = {}
K = FaultKind


def bug(*kinds: FaultKind, mission: Mission = MISSION) -> Callable[[Patch], Patch]:
    """Register a planted bug under its function's name, with faults and mission under which it is looked for."""

    def registered(patch: Patch) -> Patch:
        BUGS[patch.__name__] = patch, kinds, mission
        return patch

    return registered


def put(owner: object, name: str, value: object) -> mock._patch:
    return mock.patch.object(owner, name, value)


# -- the controller's verifier and publisher


@bug(K.SOLVER)
def verifier_admits_everything() -> list[mock._patch]:
    return [put(SafetyFilter, "admit", lambda self, trajectory, state, incumbent: Verdict(admitted=True))]


def _filter_without(**changes: object) -> mock._patch:
    init = SafetyFilter.__init__

    def blind(self: SafetyFilter, mission: Mission) -> None:
        init(self, mission)
        self._fleet = replace(self._fleet, **changes)

    return put(SafetyFilter, "__init__", blind)


@bug(K.SOLVER)
def separation_is_not_verified() -> list[mock._patch]:
    return [_filter_without(separation_min=0.0)]


@bug(K.SOLVER, mission=TIGHT)
def range_is_not_verified() -> list[mock._patch]:
    return [_filter_without(communication_range=np.inf)]


@bug(K.SOLVER)
def a_refused_plan_is_sent_all_the_same() -> list[mock._patch]:
    admit = SafetyFilter.admit

    def lenient(self: SafetyFilter, trajectory: object, state: object, incumbent: object) -> Verdict:
        malformed = self._malformed(trajectory, state)
        return admit(self, trajectory, state, incumbent) if malformed else Verdict(admitted=True)

    return [put(SafetyFilter, "admit", lenient)]


def _fleet_with(change: Callable[[object], dict]) -> list[mock._patch]:
    """Planner and verifier read another fleet out of the mission."""
    right = safety_filter.tightened

    def wrong(mission: Mission) -> object:
        fleet = right(mission)
        return replace(fleet, **change(fleet))

    return [put(safety_filter, "tightened", wrong), put(planning_constraints, "tightened", wrong)]


@bug(K.DUPLICATES, K.CUTS)
def half_the_separation_is_asked_for() -> list[mock._patch]:
    return _fleet_with(lambda fleet: {"separation_min": 0.3 * fleet.separation_min})


@bug(K.DUPLICATES, K.CUTS, mission=TIGHT)
def the_range_is_taken_for_more() -> list[mock._patch]:
    return _fleet_with(lambda fleet: {"communication_range": 1.4 * fleet.communication_range})


def _message(change: Callable[[dict, int], dict]) -> mock._patch:
    make = PlanPublisher._message

    def changed(self: PlanPublisher, plan: object, index: int, link: AgentLink, origin_s: float) -> object:
        message = make(self, plan, index, link, origin_s)
        fields = {name: getattr(message, name) for name in message.__struct_fields__}
        return type(message)(**change(fields, index))

    return put(PlanPublisher, "_message", changed)


def _not_checking(*names: str) -> list[mock._patch]:
    return [put(agent_module, name, lambda *given: None) for name in names]


@bug(K.DUPLICATES, K.LOSS)
def one_agent_starts_each_plan_a_period_late() -> list[mock._patch]:
    def late(fields: dict, index: int) -> dict:
        more = fields["period_s"] if index == 0 else 0.0
        return {**fields, "start_s": fields["start_s"] + more, "valid_until_s": fields["valid_until_s"] + more}

    return [_message(late), *_not_checking("check_start")]


@bug(K.DUPLICATES, K.LOSS)
def a_shifted_plan_is_shifted_by_one_period_too_much() -> list[mock._patch]:
    """The rest of a plan is sent as if it began a sample later."""

    def shifted(fields: dict, index: int) -> dict:
        if index != 1 or len(fields["input"]) < 3:
            return fields
        cut = {name: [*fields[name][1:], fields[name][-1]] for name in ("position", "velocity")}
        return {**fields, **cut, "input": [*fields["input"][1:], [0.0, 0.0]]}

    return [_message(shifted), *_not_checking("check_start", "check_content")]


@bug(K.BURSTS, K.CUTS, K.DEATHS)
def plans_do_not_end_at_rest() -> list[mock._patch]:
    """Plans are cut after three samples, and the last velocity is held."""

    def cut(fields: dict, index: int) -> dict:
        short = {name: fields[name][:4] for name in ("position", "velocity")}
        return {**fields, **short, "input": fields["input"][:3]}

    return [_message(cut), *_not_checking("check_content"), _holding_velocity()]


def _holding_velocity() -> mock._patch:
    hold = Schedule.hold

    def held(self: Schedule, time_s: float, velocity: np.ndarray) -> tuple[np.ndarray, float]:
        if self.flying(time_s) is None:
            return np.zeros_like(velocity), self.queue[0].motion.start_time if self.queue else np.inf
        return hold(self, time_s, velocity)

    return put(Schedule, "hold", held)


@bug(K.DUPLICATES, K.LOSS)
def agents_get_each_others_plans() -> list[mock._patch]:
    publish = PlanPublisher.publish

    def crossed(self: PlanPublisher, trajectory: object, *given: object) -> Verdict:
        order = [1, 0, 2]
        turned = replace(
            trajectory,
            position=trajectory.position,
            velocity=trajectory.velocity[:, order],
            input=trajectory.input[:, order],
        )
        state = given[0]
        turned = state.trajectory(turned.velocity[1:], trajectory.period) if len(turned.input) else trajectory
        with mock.patch.object(SafetyFilter, "admit", return_value=Verdict(admitted=True)):
            return publish(self, turned, *given)

    return [put(PlanPublisher, "publish", crossed)]


@bug(K.LOSS, K.BURSTS, K.DELAY)
def plans_that_were_sent_since_a_report_are_forgotten() -> list[mock._patch]:
    return [
        put(PlanPublisher, "_unreported", lambda self, index, link, reported: []),
        *_not_checking("check_start"),
    ]


# -- lost agents


@bug(K.DEATHS, K.CUTS, K.STOPS)
def lost_agents_are_no_obstacles() -> list[mock._patch]:
    far = np.array([1e3, 1e3])
    rest_of = FleetSupervisor._rest_of

    def elsewhere(self: FleetSupervisor, index: int) -> object:
        return resting(far + index) if index in self._detector.lost else rest_of(self, index)

    return [put(FleetSupervisor, "_rest_of", elsewhere), put(FleetSupervisor, "_stopping_motion", lambda *given: None)]


@bug(K.CUTS, K.STOPS, K.BURSTS, mission=CROWD)
def the_way_of_a_silent_agent_is_no_obstacle() -> list[mock._patch]:
    return [put(FleetSupervisor, "_stopping_motion", lambda self, index, origin_s: None)]


@bug(K.CUTS, K.STOPS, K.DEATHS)
def lost_agents_are_where_they_started() -> list[mock._patch]:
    init = FleetSupervisor.__init__

    def noted(self: FleetSupervisor, mission: Mission, *given: object, **options: object) -> None:
        init(self, mission, *given, **options)
        self.starts = mission.fleet.start

    return [
        put(FleetSupervisor, "__init__", noted),
        put(FleetSupervisor, "_rest_of", lambda self, index: resting(self.starts[index])),
        put(FleetSupervisor, "_stopping_motion", lambda *given: None),
    ]


@bug(K.CUTS, K.STOPS)
def lost_links_are_taken_for_deaths() -> list[mock._patch]:
    """Who is cut off is thought to brake at once, and flies on."""
    return [_modes(FailureMode.PROCESS_DIED)]


@bug(K.DEATHS, mission=CROWD)
def deaths_are_taken_for_lost_links() -> list[mock._patch]:
    """Who died is thought to fly its plan to the end, and brakes at once."""
    return [_modes(FailureMode.LINK_LOST)]


def _modes(mode: FailureMode) -> mock._patch:
    newly = FailureDetector.newly_lost
    return put(FailureDetector, "newly_lost", lambda self, now_s: dict.fromkeys(newly(self, now_s), mode))


@bug(K.DEATHS, K.CUTS)
def nobody_is_ever_lost() -> list[mock._patch]:
    return [put(FailureDetector, "newly_lost", lambda self, now_s: {})]


@bug(K.CUTS, K.STOPS, K.RESTARTS)
def lost_agents_are_back_at_their_last_word() -> list[mock._patch]:
    """Who is lost is readmitted at once, as if it had been heard."""
    return [put(FailureDetector, "recovered", lambda self, now_s, patience_s: list(self.lost))]


@bug(K.DEATHS, mission=CROWD)
def the_dead_stop_where_they_were_heard_last() -> list[mock._patch]:
    def at_once(self: StatePredictor, index: int, link: AgentLink, time_s: float, died_s: float) -> object:
        return resting(link.measured()[0])

    return [
        put(StatePredictor, "predict_braked", at_once),
        put(FleetSupervisor, "_stopping_motion", lambda *given: None),
    ]


# -- what agents take


@bug(K.TAKEOVERS, mission=LONG)
def old_epochs_are_accepted() -> list[mock._patch]:
    """Agents take old epochs, and a controller that was taken over does not mind."""
    return [
        put(Authority, "check", lambda self, message: None),
        put(FleetMonitor, "newest_epoch", lambda self: 0),
        *_not_checking("check_start"),
    ]


@bug(K.LOSS, K.DUPLICATES)
def plans_are_flown_as_soon_as_they_come() -> list[mock._patch]:
    def adopt(self: Agent, plan: object, now: float) -> None:
        self.schedule.add(replace(plan, motion=plan.motion.shift(now - plan.motion.start_time)))

    return [put(Agent, "_adopt", adopt)]


@bug(K.DUPLICATES, K.LOSS)
def the_states_of_two_agents_are_mixed_up() -> list[mock._patch]:
    predicted = FleetSupervisor._predict_agent
    other = {0: 1, 1: 0}
    wrong = put(
        FleetSupervisor, "_predict_agent", lambda self, index, at_s: predicted(self, other.get(index, index), at_s)
    )
    return [wrong, *_not_checking("check_start")]


@bug(K.DUPLICATES, K.LOSS)
def plans_start_from_standstill_whatever_the_velocity() -> list[mock._patch]:
    predicted = FleetSupervisor._predict_agent
    still = put(FleetSupervisor, "_predict_agent", lambda self, index, at_s: resting(predicted(self, index, at_s)[0]))
    return [still, *_not_checking("check_start")]


@bug(K.REORDER, K.DUPLICATES)
def sequence_numbers_of_plans_are_ignored() -> list[mock._patch]:
    def check(self: Authority, message: object) -> None:
        return None

    return [put(Authority, "check", check), *_not_checking("check_time", "check_start")]


@bug(K.LOSS, K.DELAY, K.SLOW, K.STOPS, mission=CROWD)
def plans_that_start_elsewhere_are_flown() -> list[mock._patch]:
    return _not_checking("check_start")


@bug(K.DELAY, K.REORDER)
def expired_plans_are_flown() -> list[mock._patch]:
    return _not_checking("check_time", "check_start")


@bug(K.SOLVER)
def limits_are_checked_by_nobody() -> list[mock._patch]:
    loose = put(plan_filter, "LIMIT_TOLERANCE", 10.0)
    return [loose, *_loose_limits()]


def _loose_limits() -> list[mock._patch]:
    init = SafetyFilter.__init__

    def blind(self: SafetyFilter, mission: Mission) -> None:
        init(self, mission)
        fleet = self._fleet
        self._fleet = replace(fleet, speed_max=4.0 * fleet.speed_max, input_max=4.0 * fleet.input_max)

    return [put(SafetyFilter, "__init__", blind)]


@bug(K.LOSS, K.REORDER)
def every_third_plan_waits_until_the_one_in_flight_has_ended() -> list[mock._patch]:
    def adopt(self: Agent, plan: object, now: float) -> None:
        flown = self.schedule.flown
        wait_s = max(0.0, flown.motion.end_time - plan.motion.start_time) if flown and plan.ref.seq % 3 == 2 else 0.0
        self.schedule.add(replace(plan, motion=plan.motion.shift(wait_s)))

    return [put(Agent, "_adopt", adopt)]


@bug(K.LOSS, K.BURSTS, K.CUTS)
def the_last_velocity_is_held_when_nothing_new_comes() -> list[mock._patch]:
    """After three samples of a plan without another one, an agent goes on at the velocity that it has."""
    flying = Schedule.flying

    def impatient(self: Schedule, time_s: float) -> object:
        plan = flying(self, time_s)
        return plan if plan is not None and plan.motion.index(time_s) < 3 else None

    def advance(self: Plant, until_s: float, schedule: Schedule) -> None:
        with mock.patch.object(Schedule, "flying", impatient), _holding_velocity():
            plain(self, until_s, schedule)

    plain = Plant.advance
    tick = Agent.tick

    def ticking(self: Agent) -> None:
        with mock.patch.object(Plant, "advance", advance):
            tick(self)

    return [put(Agent, "tick", ticking)]


@bug(K.STOPS, K.SLOW)
def a_plan_that_comes_late_is_flown_from_its_first_sample() -> list[mock._patch]:
    def adopt(self: Agent, plan: object, now: float) -> None:
        late_s = max(0.0, now - plan.motion.start_time)
        self.schedule.add(replace(plan, motion=plan.motion.shift(late_s)))

    return [put(Agent, "_adopt", adopt), *_not_checking("check_time")]


@bug(K.RESTARTS)
def a_restarted_agent_thinks_to_be_at_the_missions_start() -> list[mock._patch]:
    make = agent_module.make_vehicle
    return [put(agent_module, "make_vehicle", lambda *given: make(*given[:5]))]


@bug(K.BURSTS, K.LOSS, K.CUTS)
def every_plan_is_thought_to_be_taken_up() -> list[mock._patch]:
    schedule = PlanPublisher.schedule

    def believed(self: PlanPublisher, index: int, link: AgentLink) -> Schedule:
        sent = self._sent[index]
        return Schedule(float(self._input_max[index]), sent[-1].plan) if sent else schedule(self, index, link)

    return [put(PlanPublisher, "schedule", believed)]


@bug(K.CUTS, K.STOPS, mission=CROWD)
def who_is_silent_is_never_lost() -> list[mock._patch]:
    return [put(failure_detector, "SILENT_PART", 1e3), put(failure_detector, "TOKEN_LOST_PERIODS", 1e3)]


# -- clocks and states


@bug(K.DELAY)
def the_clock_of_the_newest_message_is_trusted() -> list[mock._patch]:
    """The offset of an agent's clock is that of its last message, whatever its delay, in flight as well."""
    accept = AgentLink.accept

    def newest(self: AgentLink, state: object, received_s: float) -> bool:
        self._smallest, self._frozen = np.inf, None
        return accept(self, state, received_s)

    return [put(AgentLink, "accept", newest), *_not_checking("check_start")]


@bug(K.REORDER, mission=CROWD)
def sequence_numbers_of_states_are_ignored() -> list[mock._patch]:
    return [put(AgentLink, "_check", lambda self, state: None), *_not_checking("check_start")]


@bug(K.TWINS)
def whoever_says_to_be_an_agent_is_believed() -> list[mock._patch]:
    return [put(FleetMonitor, "_check_instance", lambda self, link, state, now_s: None)]


@bug(K.STOPS, K.SLOW, K.SOLVER, mission=CROWD)
def a_late_controller_sends_plans_for_times_that_are_past() -> list[mock._patch]:
    never = put(control_step.ControlStep, "_late", lambda self, start_s, done_s: False)
    return [never, *_not_checking("check_time", "check_start")]


@bug(K.SLOW, K.DUPLICATES)
def mission_time_is_a_period_ahead_of_the_plans() -> list[mock._patch]:
    start = MissionClock.planned_start

    def ahead(self: MissionClock, tick: int) -> float:
        return start(self, tick) + (self._period_s if tick % 4 == 3 else 0.0)

    return [put(MissionClock, "planned_start", ahead), *_not_checking("check_start")]


# -- what is claimed


@bug(K.DUPLICATES)
def sensing_radii_are_taken_for_larger() -> list[mock._patch]:
    init = CoverageMap.__init__

    def wide(self: CoverageMap, mission: Mission, margin_m: float | None = None) -> None:
        init(self, mission, -0.6 if margin_m is None else margin_m)

    return [put(CoverageMap, "__init__", wide)]


@bug(K.DUPLICATES, mission=LONG)
def missions_are_complete_before_everything_is_measured() -> list[mock._patch]:
    nothing_left = property(lambda self: self._coverage.covered_count > 0.25 * self._cells)
    ending = put(Completion, "ending", lambda self: (Phase.COMPLETE, "everything is covered"))
    return [put(Completion, "nothing_left", nothing_left), ending]


@bug(K.RESTARTS, K.DISK)
def a_checkpoint_is_read_as_if_everything_were_covered() -> list[mock._patch]:
    return [put(CoverageMap, "restore", lambda self, state: self.first.fill(0.0))]


@bug(K.DEATHS, K.RESTARTS)
def what_is_planned_counts_as_measured() -> list[mock._patch]:
    publish = PlanPublisher.publish
    fly_on = MissionPhases._fly

    def noting(self: PlanPublisher, trajectory: object, *given: object) -> Verdict:
        verdict = publish(self, trajectory, *given)
        self.planned = trajectory if verdict.admitted else getattr(self, "planned", None)
        return verdict

    def counting(self: MissionPhases, *, stalled: bool) -> None:
        fly_on(self, stalled=stalled)
        planned = getattr(self._control_step._publisher, "planned", None)
        for position in planned.position if planned is not None else ():
            self._coverage.observe(self._mission_clock.now(), position)

    return [put(PlanPublisher, "publish", noting), put(MissionPhases, "_fly", counting)]


# -- catching them


@contextmanager
def planted(name: str) -> Iterator[None]:
    """Plant a bug for a while."""
    patches = BUGS[name][0]()
    for patch in patches:
        patch.start()
    try:
        yield
    finally:
        for patch in reversed(patches):
            patch.stop()


@dataclass(frozen=True)
class Catch:
    """The first flight that shows a bug: its kind of faults, seed, what is violated; and how many were flown."""

    kind: str
    seed: int
    what: str
    flights: int


@cache
def clean(mission: Mission, kind: FaultKind, seed: int) -> bool:
    """Return whether nothing is violated in a flight without a planted bug."""
    _, faults = draw(mission, [kind], seed)
    return not fly(mission, faults, seed, limit_s=LIMIT_S).violations


def caught(name: str, seeds: int = SEEDS) -> Catch | None:
    """Return the first flight that shows a bug, of so many of each kind; None where there is none."""
    flights = 0
    _, kinds, mission = BUGS[name]
    for seed in range(seeds):
        for kind in kinds:
            _, faults = draw(mission, [kind], seed)
            with planted(name):
                flights += 1
                outcome = fly(mission, faults, seed, limit_s=LIMIT_S)
            if outcome.violations and clean(mission, kind, seed):
                return Catch(kind, seed, outcome.violations[0].line[:100], flights)
    return None


def main() -> int:
    """Tell of each bug whether it is caught; return 0 when no more are missed than are known to be."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", choices=[*BUGS, []])
    parser.add_argument("--seeds", type=int, default=SEEDS)
    given = parser.parse_args()
    missed = []
    for name in given.names or BUGS:
        begun_s = time.process_time()
        found = caught(name, given.seeds)
        cpu_s = time.process_time() - begun_s
        told = f"{found.kind} seed {found.seed}: {found.what}" if found else "MISSED"
        sys.stdout.write(f"{name}: {told} ({cpu_s:.0f} s)\n")
        sys.stdout.flush()
        missed += [] if found else [name]
    count = len(given.names or BUGS)
    sys.stdout.write(f"{count - len(missed)} of {count} caught; missed: {', '.join(missed) or 'none'}\n")
    return int(len(missed) > UNCAUGHT_MOST)


if (_named := os.environ.get(VARIABLE)) and __name__ != "__main__":
    for _patch in BUGS[_named][0]():
        _patch.start()


if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).parents[3]))
    sys.exit(main())
