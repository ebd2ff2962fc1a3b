"""Control laws for tests: straight sweeps without optimisation, exact on the grid; some are slow, some are faulty."""

from dataclasses import replace
from itertools import pairwise
from threading import Event

import numpy as np

from mpc_cover.control.control_law import PlanSource, Proposal
from mpc_cover.control.recovery import Mode
from mpc_cover.mission.load import Mission
from mpc_cover.model.constraint_tightening import tightened
from mpc_cover.model.motion import roll_out
from mpc_cover.model.trajectory import Trajectory


class StraightSweepLaw:
    """Goes straight up to `goal_y` [m] from wherever it is, then down again should anything be owed.

    Attributes
    ----------
    states, budgets_s : what it was asked to plan from, and in how many seconds, call by call.
    sent : the trajectories that it was told were sent.
    coverage : the map that it was handed last.
    raises : raised instead of planning, if anything.
    """

    tolerates_losses = False

    def __init__(self, mission: Mission, goal_y: float = 3.5) -> None:
        self.mission, self.goal_y, self.up = mission, goal_y, True
        self.mode = Mode.NOMINAL
        self.states, self.budgets_s, self.sent = [], [], []
        self.coverage = None
        self.raises: Exception | None = None
        control, fleet = mission.spec.control, tightened(mission)
        self._steps, self._period = control.horizon_steps, control.period_s
        self._speed_max = float(fleet.speed_max.min())
        self._push, self._brake = (part * float(fleet.input_max.min()) * self._period for part in (0.8, 0.9))
        """Change of speed in a period [m/s]."""

    @property
    def at_rest(self):
        """The states of a settled fleet."""
        return [state for state in self.states if state.settled]

    @property
    def in_flight(self):
        """The states predicted for the next tick of a flight."""
        return [state for state in self.states if not state.settled]

    def step(self, state, coverage, budget):
        self.states.append(state)
        self.budgets_s.append(budget.left_s)
        self.coverage = coverage
        if self.raises:
            raise self.raises
        return Proposal(self._sweep(state), PlanSource.NEW)

    def published(self, trajectory):
        self.sent.append(trajectory)

    def _sweep(self, state):
        if not state.velocity.any() and not self._climb(state.position[0], state.velocity[0]).any():
            self.up = not self.up
        force = np.stack([self._climb(q, v) for q, v in zip(state.position, state.velocity, strict=True)], axis=1)
        positions, velocities = roll_out(state.position, state.velocity, force, self._period)
        return Trajectory.even(state.time, self._period, positions, velocities, force)

    def _climb(self, position, velocity):
        """Accelerate for `up` steps, coast, then brake: the first of few such profiles that does not overshoot."""
        if self.coverage.complete and np.abs(velocity).max() < 1e-12:
            return np.zeros((self._steps, len(position)))
        for up in (2, 1, 0):
            for coast in range(self._steps, -1, -1):
                profile = self._profile(position, velocity, up, coast)
                if profile is not None:
                    return profile
        return self._braked(velocity, 0, 0)

    def _profile(self, position, velocity, up, coast):
        sign = 1.0 if self.up else -1.0
        peak = velocity + np.array([0.0, self._push * up * sign])
        if np.linalg.norm(peak) > self._speed_max + 1e-9:
            return None
        force = self._braked(peak, up, coast)
        if force is None:
            return None
        force[:up] = np.array([0.0, self._push * sign / self._period])
        q, _ = roll_out(position[None], velocity[None], force[:, None], self._period)
        inside = q[:, 0, 1].min() >= 0.5 - 1e-9 and q[:, 0, 1].max() <= self.goal_y + 1e-9
        return force if inside else None

    def _braked(self, peak, up, coast):
        """Return inputs that brake from the peak velocity after so many steps; None where the horizon is too short."""
        down = int(np.ceil(np.linalg.norm(peak) / self._brake - 1e-9))
        if up + coast + down > self._steps:
            return None
        force = np.zeros((self._steps, len(peak)))
        if down:
            force[up + coast : up + coast + down] = -peak / (down * self._period)
        return force


class SharingLaw(StraightSweepLaw):
    """A sweep that goes on without the lost; what it plans for them is never sent."""

    tolerates_losses = True

    @property
    def lost(self):
        """Who was lost, (m,) each time that it changed."""
        nobody = [False] * self.mission.fleet.size
        masks = [nobody, *(state.lost.tolist() for state in self.states)]
        return [after for before, after in pairwise(masks) if after != before]

    @property
    def slowed(self):
        """Agent number and share of its speed, each time that an agent was found to be slower than thought."""
        shares = [np.ones(self.mission.fleet.size), *(state.speed_share for state in self.states)]
        return [
            (index, float(after[index]))
            for before, after in pairwise(shares)
            for index in np.flatnonzero(after < before).tolist()
        ]


class SlowLaw(StraightSweepLaw):
    """Takes `takes_s` of the clock for each of some steps, given by their number in flight."""

    def __init__(self, mission, clock, takes_s, slow):
        super().__init__(mission)
        self._clock, self._takes_s, self._slow = clock, takes_s, slow

    def step(self, state, coverage, budget):
        if not state.settled and len(self.in_flight) in self._slow:
            self._clock.wait_until(self._clock.now() + self._takes_s, Event())
        return super().step(state, coverage, budget)


class ThoughtfulLaw(SharingLaw):
    """Wants to think at rest in its third step."""

    def step(self, state, coverage, budget):
        proposal = super().step(state, coverage, budget)
        self.mode = Mode.REPLAN_AT_REST if not state.settled and len(self.in_flight) == 3 else Mode.NOMINAL
        return proposal


def collision(plan, state):
    """Fly towards each other until both are at one place, within every other limit."""
    later = np.zeros_like(plan.velocity[1:])
    later[:5, 0, 0], later[:5, 1, 0] = 0.3, -0.3
    speed = state.velocity[:, 1] - 0.3 * np.arange(1, len(later) + 1)[:, None] * np.sign(state.velocity[:, 1])
    later[:, :, 1] = np.where(np.sign(speed) == np.sign(state.velocity[:, 1]), speed, 0.0)
    return state.trajectory(later, plan.period)


def never_at_rest(plan, state):
    """Go on at the end as fast as at first, from where it is."""
    later = np.zeros_like(plan.velocity[1:])
    later[:, :, 1] = np.where(state.velocity[:, 1] > 0.0, state.velocity[:, 1], 0.1)
    return state.trajectory(later, plan.period)


def _with(plan, name, value):
    array = getattr(plan, name).copy()
    array[np.unravel_index(array.size // 2, array.shape)] = value
    return replace(plan, **{name: array})


def _cut(plan, agents):
    return replace(
        plan, position=plan.position[:, :agents], velocity=plan.velocity[:, :agents], input=plan.input[:, :agents]
    )


FAULTS = {
    "a collision": (collision, "separation"),
    "a velocity that is no number": (lambda plan, _: _with(plan, "velocity", np.nan), "velocity must be finite"),
    "a position that is no number": (lambda plan, _: _with(plan, "position", np.nan), "position must be finite"),
    "an input without bound": (lambda plan, _: _with(plan, "input", np.inf), "input must be finite"),
    "an input beyond measure": (lambda plan, _: _with(plan, "input", 1e300), "numbers"),
    "a time that is no number": (lambda plan, _: plan.shift(np.nan), "samples must lie every 0.5 s"),
    "no rest at its end": (never_at_rest, "rest at the end"),
    "one agent too few": (lambda plan, _: _cut(plan, 1), "position has shape"),
    "a sample too few": (lambda plan, _: replace(plan, input=plan.input[:-1]), "input has shape"),
    "no samples": (
        lambda plan, _: Trajectory(np.empty(0), *(np.empty((0, 2, 2)) for _ in range(3)), plan.period),
        "with one step at the least",
    ),
    "one sample": (lambda plan, _: plan.slice(0, 0), "with one step at the least"),
    "a start elsewhere": (
        lambda plan, _: replace(plan, position=plan.position + np.array([0.1, 0.0])),
        "start position",
    ),
    "a start at another time": (lambda plan, _: plan.shift(0.5), "samples must lie every 0.5 s"),
    "a jump": (lambda plan, _: _with(plan, "position", 1.0), "dynamics of position"),
    "another period": (lambda plan, _: replace(plan, period=0.25), "must be 0.5 s"),
    "no period": (lambda plan, _: replace(plan, period=np.nan), "must be 0.5 s"),
    "a matrix for its times": (lambda plan, _: replace(plan, time=plan.time[None]), "time has shape"),
    "words for numbers": (lambda plan, _: replace(plan, input=plan.input.astype(str)), "input must be an array"),
    "lists for arrays": (lambda plan, _: replace(plan, input=plan.input.tolist()), "input must be an array"),
    "no trajectory": (lambda _, __: None, "time must be an array"),
}
"""What makes a good plan faulty, given the state that it is for; and words of the reason for which it is refused."""


class FaultyLaw(StraightSweepLaw):
    """A sweep whose proposals have a fault, by a name in `FAULTS`, from call number `first` on.

    Attributes
    ----------
    good : the trajectories without a fault.
    """

    def __init__(self, mission, fault, first=0, goal_y=3.5):
        super().__init__(mission, goal_y)
        self.good = []
        self._fault, self._first = FAULTS[fault][0], first

    def recovers(self):
        """Propose nothing faulty any more."""
        self._fault = lambda plan, _: plan

    def step(self, state, coverage, budget):
        proposal = super().step(state, coverage, budget)
        if len(self.states) <= self._first:
            self.good.append(proposal.trajectory)
            return proposal
        return replace(proposal, trajectory=self._fault(proposal.trajectory, state))


class EveryFaultLaw(StraightSweepLaw):
    """A sweep with each fault in turn: two good plans, then one after two faulty ones, at last nothing but collisions.

    `told` hears of each good plan.
    """

    def __init__(self, mission, goal_y, told):
        super().__init__(mission, goal_y)
        self._faults, self._told = [fault for fault, _ in FAULTS.values()], told

    def step(self, state, coverage, budget):
        proposal, number = super().step(state, coverage, budget), len(self.states) - 3
        if (number < 0 or number % 3 == 2) and self._faults:
            self._told(proposal.trajectory)
            return proposal
        fault = self._faults.pop(0) if self._faults else collision
        return replace(proposal, trajectory=fault(proposal.trajectory, state))


class WatchedLaw:
    """A control law as it is; the map that it was handed last can be looked at."""

    def __init__(self, law):
        self.law, self.coverage, self.states = law, None, []
        self.tolerates_losses = law.tolerates_losses

    @property
    def mode(self):
        return self.law.mode

    def step(self, state, coverage, budget):
        self.coverage = coverage
        self.states.append(state)
        return self.law.step(state, coverage, budget)

    def published(self, trajectory):
        self.law.published(trajectory)
