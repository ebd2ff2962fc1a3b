"""Supervises the fleet: who is lost, back, slow or off its plan, and where everyone will be."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.control.reachability import reachable
from mpc_cover.model.constraint_tightening import tightened, without_lost
from mpc_cover.model.fleet_state import FleetState
from mpc_cover.model.trajectory import SNAP_S
from mpc_cover.service.agent.recorded_motion import motion_of, rests_from
from mpc_cover.service.controller.failure_detector import SILENT_PART, FailureDetector, FailureMode
from mpc_cover.service.controller.plan_publisher import UnknownPlanError
from mpc_cover.service.controller.speed_estimation import SpeedEstimator
from mpc_cover.service.controller.state_prediction import StatePredictor, resting

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from mpc_cover.arrays import BoolArray
    from mpc_cover.mission.load import Mission
    from mpc_cover.model.trajectory import Trajectory
    from mpc_cover.service.agent.vehicle import MotionState
    from mpc_cover.service.controller.fleet_monitor import FleetMonitor
    from mpc_cover.service.controller.plan_publisher import PlanPublisher

MOVED_M = 1e-4
"""Whoever moved further than this during the planning was not at rest [m]."""
FAR_HORIZONS = 3.0
"""After so many horizons everyone has flown whatever it may have been sent."""


class FleetSupervisor:
    """Judges the agents by their reports, and tells the state of the fleet that plans are to be made for.

    A law that does not tolerate losses makes the fleet regroup instead: `assess` says so.

    Parameters
    ----------
    mission, fleet, publisher : who flies what.
    tolerates_losses : whether plans can do without agents that are lost.
    rests : where agents rest, (d,) [m], that an earlier controller had lost.
    tell : told events, of a kind, in words.
    """

    def __init__(
        self,
        mission: Mission,
        fleet: FleetMonitor,
        publisher: PlanPublisher,
        rests: Mapping[str, Sequence[float]],
        tell: Callable[[str, str], None],
        *,
        tolerates_losses: bool,
    ) -> None:
        control = mission.spec.control
        self.fleet = fleet
        self._ids = mission.fleet.ids
        self._publisher, self._tell, self._tolerates_losses = publisher, tell, tolerates_losses
        self._detector = FailureDetector(mission, fleet)
        self._predictor = StatePredictor(mission, publisher)
        self._speeds = SpeedEstimator(mission)
        self._horizon_s = control.horizon_steps * control.period_s
        self._rests = {self._ids.index(name): np.array(place) for name, place in rests.items() if name in self._ids}
        self._straying: set[int] = set()
        self._on_earlier_versions: list[str] = []
        self.take_up(mission)
        if self._rests and tolerates_losses:
            self._detector.lost = dict.fromkeys(self._rests, FailureMode.BRAKES)

    def take_up(self, mission: Mission) -> None:
        """Judge what can be measured by a version of the mission, for the same fleet."""
        self._tight, self._cell = tightened(mission), mission.field.cell
        self._reachable: tuple[frozenset[int], BoolArray] | None = None

    def tell_versions(self) -> None:
        """Tell whose mission file is an earlier version, when that has changed."""
        before, self._on_earlier_versions = self._on_earlier_versions, self.fleet.on_earlier_versions()
        if self._on_earlier_versions and self._on_earlier_versions != before:
            names = ", ".join(self._on_earlier_versions)
            self._tell("versions", f"started with an earlier version of this mission, for the same fleet: {names}")

    @property
    def lost(self) -> list[str]:
        """The names of those that the others do without."""
        return self._detector.ids()

    def assess(self, now_s: float, patience_s: float) -> str:
        """See who is lost, back or slow; return why everyone should rather stop and wait, if so."""
        self._learn_speeds()
        for name in self.fleet.reborn:  # no plan of before is for it
            self._publisher.forget(self._ids.index(name))
        if not self._tolerates_losses:
            return self._who_is_missed(now_s)
        lost = self._detector.lost
        back, gone = self._detector.back(now_s, patience_s), self._detector.gone(now_s)
        if len(lost) - len(back) + len(gone) == len(self._ids):
            self._detector.lost = {}
            return "nobody is heard"
        for index in back:
            del lost[index]
            self._readmit(index)
        for index, fate in gone.items():
            lost[index] = fate
            self._note_loss(index)
        return ""

    def missing(self, now_s: float, patience_s: float) -> list[str]:
        """Return what is still missing before everyone who is not lost is here and at rest."""
        awaited = self.fleet.awaited(now_s, patience_s)
        return [text for name, text in awaited.items() if name not in self.lost]

    def at_rest(self, mission_time_s: float) -> FleetState:
        """Return the state of a fleet at rest: where it is by its plans, and where the lost are."""
        links, lost = enumerate(self.fleet.links), self._detector.lost
        return self._state([self._rest_of(i) if i in lost else link.planned() for i, link in links], mission_time_s)

    def moved_from(self, state: FleetState) -> bool:
        """Return whether anyone who is not lost is elsewhere than a state says."""
        here = [index for index in range(len(self._ids)) if index not in self._detector.lost]
        return bool((np.abs(self.at_rest(state.time).position - state.position)[here] > MOVED_M).any())

    def predicted(self, time_s: float, mission_time_s: float, origin_s: float) -> FleetState:
        """Return the state of the fleet at `time_s` of the controller's clock; mission time 0 is at `origin_s` of it.

        Raises
        ------
        UnknownPlanError
            Someone flies a plan that this controller did not send.
        """
        self._note_strays()
        states = [self._ahead(index, time_s) for index in range(len(self._ids))]
        courses = {index: self._course_of(index, origin_s) for index in self._detector.lost}
        moving = {i: course for i, course in courses.items() if course and course.end_time > time_s - origin_s}
        return replace(self._state(states, mission_time_s), obstacles=moving, settled=False)

    @property
    def reachable(self) -> BoolArray:
        """(J, K), what those who are not lost can measure."""
        lost = frozenset(self._detector.lost)
        if self._reachable is None or self._reachable[0] != lost:
            able = np.ones((self._tight.radius.shape[1], len(self._cell)), dtype=bool)
            if lost:
                places = np.array([self._rest_of(index)[0] for index in sorted(lost)])
                able = reachable(without_lost(self._tight, self._lost_mask()), self._cell, places)
            self._reachable = lost, able
        return self._reachable[1]

    def settled(self, now_s: float) -> bool:
        """Return whether everyone who is not lost was heard just now and does not move any more."""
        late = set(self.fleet.late(now_s))
        here = [(index, link) for index, link in enumerate(self.fleet.links) if index not in self._detector.lost]
        try:
            return all(link.id not in late and self._predictor.settled(index, link) for index, link in here)
        except UnknownPlanError:
            return False

    def resting_places(self) -> dict[str, list[float]]:
        """Return where the lost come to rest, (d,) [m], for a successor."""
        return {self._ids[index]: self._rest_of(index)[0].tolist() for index in self._detector.lost}

    def _ahead(self, index: int, time_s: float) -> MotionState:
        if index in self._detector.lost:
            return self._rest_of(index)
        link = self.fleet.links[index]
        return self._predictor.ahead(index, link, time_s, self._speeds.speed_max(index, link))

    def _rest_of(self, index: int) -> MotionState:
        """Return where someone lost comes to rest: braked when it died, or at the end of its plan."""
        link = self.fleet.links[index]
        if link.state is None:
            return resting(self._rests[index])
        end_s = link.measured_s() + FAR_HORIZONS * self._horizon_s
        if self._detector.lost[index] is FailureMode.FLIES_ON:
            try:
                return resting(self._predictor.ahead(index, link, end_s, self._speeds.speed_max(index, link))[0])
            except UnknownPlanError:
                return resting(link.measured()[0])
        return resting(self._predictor.braked(index, link, end_s, self.fleet.token_went_s(link))[0])

    def _course_of(self, index: int, origin_s: float) -> Trajectory | None:
        """Return how someone lost comes to rest, in mission time; None when that is not known."""
        link = self.fleet.links[index]
        if link.state is None:
            return None
        died_s = self.fleet.token_went_s(link) if self._detector.lost[index] is FailureMode.BRAKES else None
        end_s = link.measured_s() + FAR_HORIZONS * self._horizon_s
        try:
            motion = motion_of(self._predictor.course(index, link, end_s, died_s).pieces)
        except UnknownPlanError:
            return None
        last = int(np.searchsorted(motion.time, rests_from(motion) + SNAP_S)) - 1
        return motion.slice(0, last).shift(link.offset - origin_s)

    def _who_is_missed(self, now_s: float) -> str:
        if self.fleet.reborn:
            return f"{', '.join(self.fleet.reborn)} started anew"
        patience_s = SILENT_PART * self._horizon_s
        late = self.fleet.late(now_s, patience_s)
        return f"{', '.join(late)} not heard for {patience_s:g} s" if late else ""

    def _note_loss(self, index: int) -> None:
        name = self._ids[index]
        self._tell(_kind("lost", name), f"{name} is lost: its work is shared out")

    def _readmit(self, index: int) -> None:
        name, link = self._ids[index], self.fleet.links[index]
        link.freeze()
        self._speeds.forget(index)
        self._tell(_kind("back", name), f"{name} is back: work is shared with it again")

    def _learn_speeds(self) -> None:
        for index, link in enumerate(self.fleet.links):
            if index not in self._detector.lost and self._speeds.learn(index, link):
                part = float(self._speeds.part[index])
                self._tell(_kind("slow", link.id), f"{link.id} is slow: plans ask for {part:.0%} of its speed")

    def _lost_mask(self) -> BoolArray:
        return np.isin(np.arange(len(self._ids)), list(self._detector.lost))

    def _state(self, states: list[MotionState], mission_time_s: float) -> FleetState:
        """Return the state of a fleet at rest whose agents are in these (d,) states."""
        return FleetState(
            np.array([position for position, _ in states]),
            np.array([velocity for _, velocity in states]),
            mission_time_s,
            lost=self._lost_mask(),
            speed_share=self._speeds.part.copy(),
            settled=True,
        )

    def _note_strays(self) -> None:
        links = enumerate(self.fleet.links)
        straying = {i for i, link in links if i not in self._detector.lost and self._predictor.strays(link)}
        for index in sorted(straying - self._straying):
            name = self._ids[index]
            self._tell(_kind("strays", name), f"{name} strays from its plan: the next one starts where it is")
        self._straying = straying


def _kind(what: str, name: str) -> str:
    return f"{what}-{name}"[:64]
