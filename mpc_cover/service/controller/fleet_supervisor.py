"""Supervises the fleet: which agents are lost, recovered, slow or off their plans, and their predicted states."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.control.reachability import reachable
from mpc_cover.model.constraint_tightening import tightened, without_lost
from mpc_cover.model.fleet_state import FleetState
from mpc_cover.model.trajectory import SNAP_S, Trajectory
from mpc_cover.service.agent.recorded_motion import motion_of, rests_from
from mpc_cover.service.controller.failure_detector import SILENT_PART, FailureDetector, FailureMode
from mpc_cover.service.controller.plan_publisher import UnknownPlanError
from mpc_cover.service.controller.speed_estimation import SpeedEstimator
from mpc_cover.service.controller.state_prediction import StatePredictor, resting

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from mpc_cover.arrays import BoolArray
    from mpc_cover.mission.load import Mission
    from mpc_cover.service.agent.vehicle import MotionState
    from mpc_cover.service.controller.fleet_monitor import FleetMonitor
    from mpc_cover.service.controller.plan_publisher import PlanPublisher
    from mpc_cover.service.protocol.messages import PlanRef

MOVED_M = 1e-4
"""An agent that moved further than this during the planning was not at rest [m]."""
FAR_HORIZONS = 3.0
"""After so many horizons every agent has flown all plans that it may have received."""


class FleetSupervisor:
    """Evaluates the agents' reports, and returns the state of the fleet from which to plan.

    For a law that does not tolerate losses, `assess` returns a reason to regroup instead.

    Parameters
    ----------
    mission, monitor, publisher : the mission, the agents' reports, and the plans sent to them.
    rest_positions : where agents rest, (d,) [m], that an earlier controller had lost, by id.
    emit : publishes an event of a kind, with a text.
    tolerates_losses : whether plans can do without agents that are lost.
    """

    def __init__(
        self,
        mission: Mission,
        monitor: FleetMonitor,
        publisher: PlanPublisher,
        rest_positions: Mapping[str, Sequence[float]],
        emit: Callable[[str, str], None],
        *,
        tolerates_losses: bool,
    ) -> None:
        control = mission.spec.control
        self.monitor = monitor
        self._ids = mission.fleet.ids
        self._publisher, self._emit, self._tolerates_losses = publisher, emit, tolerates_losses
        self._detector = FailureDetector(mission, monitor)
        self._predictor = StatePredictor(mission, publisher)
        self._speeds = SpeedEstimator(mission)
        self._horizon_s, self._period_s = control.horizon_s, control.period_s
        known = {name: at for name, at in rest_positions.items() if name in self._ids}
        self._rest_positions = {self._ids.index(name): np.array(at) for name, at in known.items()}
        self._off_track: set[int] = set()
        self._on_earlier_versions: list[str] = []
        self.set_mission(mission)
        if self._rest_positions and tolerates_losses:
            self._detector.lost = dict.fromkeys(self._rest_positions, FailureMode.PROCESS_DIED)

    def set_mission(self, mission: Mission) -> None:
        """Compute what can be measured by a version of the mission, for the same fleet."""
        self._tight, self._cell = tightened(mission), mission.field.cell
        self._reachable: tuple[frozenset[int], BoolArray] | None = None

    def report_earlier_versions(self) -> None:
        """Emit which agents have an earlier version of the mission, if that has changed."""
        before, self._on_earlier_versions = self._on_earlier_versions, self.monitor.on_earlier_versions()
        if self._on_earlier_versions and self._on_earlier_versions != before:
            names = ", ".join(self._on_earlier_versions)
            self._emit("versions", f"started with an earlier version of this mission, for the same fleet: {names}")

    @property
    def lost(self) -> list[str]:
        """The ids of the lost agents."""
        return self._detector.lost_ids()

    def assess(self, now_s: float, patience_s: float) -> str:
        """Update which agents are lost, recovered or slow; return a reason for the fleet to regroup, empty if none."""
        self._update_speeds()
        for name in self.monitor.restarted:  # plans sent before were for its former process
            self._publisher.forget(self._ids.index(name))
        if not self._tolerates_losses:
            return self._reason_to_regroup(now_s)
        lost = self._detector.lost
        recovered, failures = self._detector.recovered(now_s, patience_s), self._detector.newly_lost(now_s)
        contradicting = self._contradicting()
        recovered = [index for index in recovered if index not in contradicting and self._is_believed_again(index)]
        failures |= {i: FailureMode.CONTRADICTS for i in contradicting if i not in lost and i not in failures}
        if len(lost) - len(recovered) + len(failures) == len(self._ids):
            self._detector.lost = {}
            return "nobody is heard"
        for index in recovered:
            del lost[index]
            self._readmit(index)
        for index, failure in failures.items():
            lost[index] = failure
            self._note_loss(index)
        return ""

    def _is_believed_again(self, index: int) -> bool:
        """Return whether nothing speaks against a lost agent's reports."""
        contradicted = self._detector.lost[index] is FailureMode.CONTRADICTS
        return not contradicted or self._predictor.rests_at_an_end(index, self.monitor.links[index])

    def _contradicting(self) -> set[int]:
        """Return the agents whose newest reports cannot be true."""
        return {index for index, link in enumerate(self.monitor.links) if self._predictor.contradicts(index, link)}

    def not_ready(self, now_s: float, patience_s: float) -> list[str]:
        """Return why agents that are not lost are not ready: not present, or not at rest."""
        not_ready = self.monitor.not_ready(now_s, patience_s)
        return [text for name, text in not_ready.items() if name not in self.lost]

    def state_at_rest(self, mission_time_s: float) -> FleetState:
        """Return the state of a fleet at rest: by its plans, and of lost agents where they rest."""
        state = self._state(self._states_at_rest(), mission_time_s)
        return replace(state, held={i: self._held_at_rest(i, state) for i in range(len(self._ids))})

    def moved_since(self, state: FleetState) -> bool:
        """Return whether any agent that is not lost has moved since a state at rest."""
        active = [index for index in range(len(self._ids)) if index not in self._detector.lost]
        position = np.array([here for here, _ in self._states_at_rest()])
        return bool((np.abs(position - state.position)[active] > MOVED_M).any())

    def _states_at_rest(self) -> list[MotionState]:
        """Return the state of each agent of a fleet at rest."""
        links, lost = enumerate(self.monitor.links), self._detector.lost
        return [self._rest_of(i) if i in lost else link.planned() for i, link in links]

    def predict(self, time_s: float, mission_time_s: float, origin_s: float) -> FleetState:
        """Return the state of the fleet at `time_s` of the controller's clock; mission time 0 is at `origin_s` of it.

        Raises
        ------
        UnknownPlanError
            An agent flies a plan that this controller did not send.
        """
        self._update_off_track()
        states = [self._predict_agent(index, time_s) for index in range(len(self._ids))]
        stopping = {index: self._stopping_motion(index, origin_s) for index in self._detector.lost}
        moving = {i: motion for i, motion in stopping.items() if motion and motion.end_time > time_s - origin_s}
        held = {index: self._held(index, time_s, origin_s) for index in range(len(self._ids))}
        return replace(self._state(states, mission_time_s), obstacles=moving, held=held, settled=False)

    @property
    def reachable(self) -> BoolArray:
        """(J, K), what the agents that are not lost can measure."""
        lost = frozenset(self._detector.lost)
        if self._reachable is None or self._reachable[0] != lost:
            able = np.ones((self._tight.radius.shape[1], len(self._cell)), dtype=bool)
            if lost:
                obstacles = np.array([self._rest_of(index)[0] for index in sorted(lost)])
                able = reachable(without_lost(self._tight, self._lost_mask()), self._cell, obstacles)
            self._reachable = lost, able
        return self._reachable[1]

    def settled(self, now_s: float) -> bool:
        """Return whether all agents that are not lost were heard just now and have come to rest for good."""
        stale = set(self.monitor.stale(now_s))
        active = [(index, link) for index, link in enumerate(self.monitor.links) if index not in self._detector.lost]
        try:
            return all(link.id not in stale and self._predictor.settled(index, link) for index, link in active)
        except UnknownPlanError:
            return False

    def without_plan(self, ref: PlanRef | None, since_s: float) -> list[str]:
        """Return the ids of agents that have reported since a time of the controller's clock not to have a plan."""
        links = [link for index, link in enumerate(self.monitor.links) if index not in self._detector.lost]
        heard = [(link.id, link.state) for link in links if link.state and link.measured_s() > since_s]
        return [name for name, state in heard if not state.at_rest and ref not in {state.plan, state.next_plan}]

    def lost_positions(self) -> dict[str, list[float]]:
        """Return where lost agents come to rest, (d,) [m], for a later controller."""
        return {self._ids[index]: self._rest_of(index)[0].tolist() for index in self._detector.lost}

    def _predict_agent(self, index: int, time_s: float) -> MotionState:
        if index in self._detector.lost:
            return self._rest_of(index)
        link = self.monitor.links[index]
        return self._predictor.predict(index, link, time_s, self._speeds.speed_max(index, link))

    def _rest_of(self, index: int) -> MotionState:
        """Return where a lost agent comes to rest: after braking since its death, or at the end of its plan."""
        link = self.monitor.links[index]
        if link.state is None:
            return resting(self._rest_positions[index])
        end_s = link.measured_s() + FAR_HORIZONS * self._horizon_s
        if self._detector.lost[index] is FailureMode.CONTRADICTS:
            return resting(self._predictor.held_if_not_believed(index, link)[-1].position[-1])
        if self._detector.lost[index] is FailureMode.LINK_LOST:
            try:
                return resting(self._predictor.predict(index, link, end_s, self._speeds.speed_max(index, link))[0])
            except UnknownPlanError:
                return resting(link.measured()[0])
        return resting(self._predictor.predict_braked(index, link, end_s, self.monitor.token_lost_s(link))[0])

    def _stopping_motion(self, index: int, origin_s: float) -> Trajectory | None:
        """Return how a lost agent comes to rest, in mission time; None when that is not known."""
        link = self.monitor.links[index]
        if link.state is None or self._detector.lost[index] is FailureMode.CONTRADICTS:
            return None
        died = self._detector.lost[index] is FailureMode.PROCESS_DIED
        died_s = self.monitor.token_lost_s(link) if died else None
        end_s = link.measured_s() + FAR_HORIZONS * self._horizon_s
        try:
            motion = motion_of(self._predictor.motion(index, link, end_s, died_s).pieces)
        except UnknownPlanError:
            return None
        last = int(np.searchsorted(motion.time, rests_from(motion) + SNAP_S)) - 1
        return motion.slice(0, last).shift(link.offset - origin_s)

    def _held_at_rest(self, index: int, state: FleetState) -> list[Trajectory]:
        """Return the motions, in mission time, of an agent of a fleet at rest: where it stays, or may have ended.

        Plans whose beginning it may not have received leave several.
        """
        places = [state.position[index]]
        if index in self._detector.lost:
            with suppress(UnknownPlanError):
                places += [motion.position[-1] for motion in self._may_fly(index, np.inf)]
        different = np.unique(np.array(places), axis=0)
        return [Trajectory.at_rest(place, state.time, self._period_s, 1) for place in different]

    def _held(self, index: int, time_s: float, origin_s: float) -> list[Trajectory]:
        """Return the motions, in mission time, of which an agent flies one; see `_may_fly`."""
        later_s = self.monitor.links[index].offset - origin_s
        return [motion.shift(later_s) for motion in self._may_fly(index, time_s)]

    def _may_fly(self, index: int, time_s: float) -> list[Trajectory]:
        """Return the motions, in its clock, of which an agent flies one; none of one whose process died.

        Raises
        ------
        UnknownPlanError
            See `predict`.
        """
        link, failure = self.monitor.links[index], self._detector.lost.get(index)
        if link.state is None or failure is FailureMode.PROCESS_DIED:
            return []
        if failure is FailureMode.CONTRADICTS:
            return self._predictor.held_if_not_believed(index, link)
        return self._predictor.held(index, link, time_s)

    def _reason_to_regroup(self, now_s: float) -> str:
        if self.monitor.restarted:
            return f"{', '.join(self.monitor.restarted)} started anew"
        timeout_s = SILENT_PART * self._horizon_s
        stale = self.monitor.stale(now_s, timeout_s)
        return f"{', '.join(stale)} not heard for {timeout_s:g} s" if stale else ""

    def _note_loss(self, index: int) -> None:
        name = self._ids[index]
        if self._detector.lost[index] is FailureMode.CONTRADICTS:
            self._emit(_kind("off", name), f"{name} reports a place where its plan does not lead: it is not believed")
        self._emit(_kind("lost", name), f"{name} is lost: its work is shared out")

    def _readmit(self, index: int) -> None:
        name, link = self._ids[index], self.monitor.links[index]
        link.freeze_offset()
        self._speeds.reset(index)
        self._emit(_kind("back", name), f"{name} is back: work is shared with it again")

    def _update_speeds(self) -> None:
        for index, link in enumerate(self.monitor.links):
            if index not in self._detector.lost and self._speeds.update(index, link):
                share = float(self._speeds.share[index])
                self._emit(_kind("slow", link.id), f"{link.id} is slow: plans ask for {share:.0%} of its speed")

    def _lost_mask(self) -> BoolArray:
        return np.isin(np.arange(len(self._ids)), list(self._detector.lost))

    def _state(self, states: list[MotionState], mission_time_s: float) -> FleetState:
        """Return the state of a fleet at rest whose agents are in these (d,) states."""
        return FleetState(
            np.array([position for position, _ in states]),
            np.array([velocity for _, velocity in states]),
            mission_time_s,
            lost=self._lost_mask(),
            speed_share=self._speeds.share.copy(),
            settled=True,
        )

    def _update_off_track(self) -> None:
        links = enumerate(self.monitor.links)
        off_track = {i for i, link in links if i not in self._detector.lost and self._predictor.off_track(link)}
        for index in sorted(off_track - self._off_track):
            name = self._ids[index]
            self._emit(_kind("strays", name), f"{name} strays from its plan: the next one starts where it is")
        self._off_track = off_track


def _kind(what: str, name: str) -> str:
    return f"{what}-{name}"[:64]
