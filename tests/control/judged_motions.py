"""Motions of box-3 for the safety filter: some with one thing wrong, and some with nothing wrong."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from flights import leg, propagate

from mpc_cover.mission.load import load_mission
from mpc_cover.model.fleet_state import FleetState
from mpc_cover.model.trajectory import Trajectory
from mpc_cover.planning.budget import Budget
from mpc_cover.planning.offline import offline_task
from mpc_cover.planning.planner import Planner

MISSION = load_mission("box-3")
START, PERIOD = MISSION.fleet.start, MISSION.spec.control.period_s
EAST = np.array([1.0, 0.0])


def at(position, velocity=None, time=0.0, **changes):
    position = np.asarray(position, dtype=float)
    velocity = np.zeros_like(position) if velocity is None else np.asarray(velocity, dtype=float)
    return replace(FleetState.nominal(position, velocity, time), **changes)


@lru_cache
def plan():
    """Return a plan of the whole mission."""
    found = Planner("piqp").quick(offline_task(MISSION), Budget.counted(1.0))
    assert found.complete
    return found.plan


def begun(rng):
    """Return what is left of the plan after some samples, and the state there."""
    done = int(rng.integers(plan().steps - 2))
    return plan().slice(done, plan().steps), at(plan().position[done], plan().velocity[done], plan().time[done])


def together(speeds):
    """Return the motion of everyone side by side to the east, at these speeds [m/s] at samples 1 to N."""
    velocity = np.asarray(speeds)[:, None, None] * np.repeat(EAST[None], 3, axis=0)
    return at(START).trajectory(velocity, PERIOD), at(START)


def moved(displacement, state=None):
    """Return the motion by (3, 2) [m] from rest to rest, and the state that it starts in."""
    state = state or at(START)
    force = leg(displacement, PERIOD, 3, 8)
    time = state.time + PERIOD * np.arange(len(force) + 1)
    return Trajectory(time, *propagate(state.position, force, time), force, PERIOD), state


def only(agent, displacement):
    return np.where(np.arange(3)[:, None] == agent, np.asarray(displacement, dtype=float), 0.0)


def passing(aside):
    """Return a motion on which two pass each other between two samples, `aside` [m] of each other."""
    position = np.array([[2.875, 2.0], [5.125, 2.0 + aside], [4.0, 4.5]])
    velocity = np.array([[1.5, 0.0], [-1.5, 0.0], [0.0, 0.0]])
    state = at(position, velocity)
    return state.trajectory(np.array([1.0, 1.0, 0.5, 0.0])[:, None, None] * velocity, PERIOD), state


def along_the_wall(outwards):
    """Return a motion that turns back before the wall, near it at two samples, at this speed outwards [m/s]."""
    velocity = only(0, [-outwards, 0.0])
    state = at([[MISSION.fleet.motion_min[0] + 0.01 + PERIOD * outwards, 2.0], *START[1:]], velocity)
    return state.trajectory(np.array([1.0, -1.0, 0.0])[:, None, None] * velocity, PERIOD), state


def past_the_lost(aside, *, moving=False):
    """Return a motion of a1 past a2, which is lost, and of which the plan says that it is far away.

    It rests, or still brakes, `aside` [m] of the way when a1 is there; then it comes to rest `ON` farther.
    """
    end = np.array([3.125, 2.0 + aside + (ON if moving else 0.0)])
    course = Trajectory(
        np.array([0.0, 2.0]), np.array([end - [0.0, 3.0], end]), np.array([[0.0, 3.0], [0, 0]]), np.array([[0.0, -1.5]])
    )
    assert not moving or course.at(1.25)[0] == pytest.approx([3.125, 2.0 + aside])
    others = START[0], [2.0, 4.5]
    state = at(
        [others[0], end, others[1]], lost=np.array([False, True, False]), obstacles={1: course} if moving else {}
    )
    velocity = np.array([0.75, 1.5, 1.5, 0.75, 0.0])[:, None, None] * only(0, EAST)
    return at([others[0], [9.0, 9.0], others[1]]).trajectory(velocity, PERIOD), state


ON = 0.421875
"""How far the lost still brakes when a1 has passed [m]."""


# what has one thing wrong


def excess(rng):
    """Return by how much too much, a little or a lot."""
    return float(10.0 ** rng.uniform(-4.0, -0.7))


def with_number(rng):
    """Return a trajectory with one number that is none, or of no motion."""
    trajectory, state = begun(rng)
    name = str(rng.choice(["time", "position", "velocity", "input"]))
    array = getattr(trajectory, name).copy()
    array.flat[rng.integers(array.size)] = rng.choice([np.nan, np.inf, -np.inf, 1e12, 1e300])
    return replace(trajectory, **{name: array}), state


def with_shape(rng):
    trajectory, state = begun(rng)
    name = str(rng.choice(["time", "position", "velocity", "input"]))
    array = getattr(trajectory, name)
    change = rng.choice(["shorter", "longer", "fewer", "flat", "none"])
    wrong = {
        "shorter": array[:-1],
        "longer": np.concatenate([array, array[-1:]]),
        "fewer": array[:, :2] if array.ndim == 3 else array[::2],
        "flat": array.reshape(len(array), -1) if array.ndim == 3 else array[:, None],
        "none": array[:0],
    }
    return replace(trajectory, **{name: wrong[str(change)]}), state


def with_start(rng):
    trajectory, state = begun(rng)
    name = str(rng.choice(["position", "velocity"]))
    array = getattr(state, name).copy()
    array.flat[rng.integers(array.size)] += rng.choice([-1.0, 1.0]) * 10.0 ** rng.uniform(-5.0, 1.0)
    return trajectory, replace(state, **{name: array})


def with_grid(rng):
    trajectory, state = begun(rng)
    time = trajectory.time.copy()
    change = rng.choice(["later", "slower", "one", "backwards"])
    if change == "later":
        time += rng.choice([-1.0, 1.0]) * 10.0 ** rng.uniform(-5.0, 2.0)
    elif change == "slower":
        time = time[0] + (time - time[0]) * (1.0 + rng.choice([-1.0, 1.0]) * 10.0 ** rng.uniform(-5.0, -0.5))
    elif change == "one":
        time[rng.integers(time.size)] += 10.0 ** rng.uniform(-5.0, -1.0)
    else:
        time = time[::-1]
    return replace(trajectory, time=time), state


def with_period(rng):
    trajectory, state = begun(rng)
    return replace(trajectory, period=float(rng.choice([np.nan, np.inf, 0.0, -0.5, 0.25, 0.5 + excess(rng)]))), state


def with_jump(rng):
    """Return a trajectory of which one sample does not follow from the one before."""
    trajectory, state = begun(rng)
    name = str(rng.choice(["position", "velocity", "input"]))
    array = getattr(trajectory, name).copy()
    sample = rng.integers(1, len(array))
    array[sample, rng.integers(3), rng.integers(2)] += rng.choice([-1.0, 1.0]) * 10.0 ** rng.uniform(-4.0, 0.0)
    return replace(trajectory, **{name: array}), state


def with_end(rng):
    """Return a trajectory that ends while someone moves."""
    trajectory, state = begun(rng)
    fast = np.flatnonzero(np.abs(trajectory.velocity).max(axis=(1, 2)) > 1e-3)
    return trajectory.slice(0, int(rng.choice(fast[fast > 0]))), state


BROKEN = {
    "a number is none": with_number,
    "a shape is wrong": with_shape,
    "another start": with_start,
    "another time grid": with_grid,
    "another period": with_period,
    "a jump": with_jump,
    "it does not end at rest": with_end,
    "too fast": lambda rng: together([0.7, 1.4, 1.5 + excess(rng), 1.4, 0.7, 0.0]),
    "too much input": lambda rng: together([0.75 + excess(rng), 0.1, 0.0]),
    "two meet between samples": lambda rng: passing(rng.uniform(-0.499, 0.499)),
    "out of the box": lambda rng: moved(np.tile([MISSION.fleet.motion_min[0] - 2.0 - excess(rng), 0.0], (3, 1))),
    "out of the box between samples": lambda rng: along_the_wall(rng.uniform(0.0801, 0.36)),
    "out of range": lambda rng: moved(only(2, [0.0, np.sqrt(5.5**2 - 1.0) - 2.0 + excess(rng)])),
    "through the lost": lambda rng: past_the_lost(rng.uniform(-0.499, 0.499)),
    "through the lost on its way to rest": lambda rng: past_the_lost(rng.uniform(0.08, 0.499), moving=True),
}


WELL = {
    "the rest of a plan": begun,
    "as fast as one may": lambda rng: together([0.7, 1.4, 1.5, 1.4, 0.7, 0.0]),
    "all the input there is": lambda rng: together([0.75, 0.0]),
    "two pass": lambda rng: passing(rng.choice([-1.0, 1.0]) * rng.uniform(0.501, 1.5)),
    "up to the wall": lambda rng: moved(np.tile([MISSION.fleet.motion_min[0] - 2.0, 0.0], (3, 1))),
    "up to the wall between samples": lambda rng: along_the_wall(rng.uniform(0.01, 0.0799)),
    "up to the range": lambda rng: moved(only(2, [0.0, np.sqrt(5.5**2 - 1.0) - 2.0])),
    "past the lost": lambda rng: past_the_lost(rng.choice([-1.0, 1.0]) * rng.uniform(0.501, 1.5)),
    "past where the lost has come to rest": lambda rng: past_the_lost(ON + rng.uniform(0.08, 0.499)),
    "past the lost on its way to rest": lambda rng: past_the_lost(rng.uniform(1.0, 2.0), moving=True),
    "it rests": lambda rng: (at(START).trajectory(np.zeros((int(rng.integers(1, 9)), 3, 2)), PERIOD), at(START)),
}
