"""The speed at which a sweep is flown: slow enough for its turns and for its looks, as fast as these allow.

An agent at speed v turns within v^2 / (2 u_max) and changes its input once a step. Where that is much more than a
sensing radius, a sweep at full speed cuts its corners and leaves what lies in them; a slower one covers more and may
take longer. Sampled sensors that pass faster than two radii a look leave gaps in any lane.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.planning.initial_guess.guess import GuessKind

if TYPE_CHECKING:
    from collections.abc import Iterator

    from mpc_cover.arrays import FloatArray
    from mpc_cover.planning.initial_guess.guess import Guess
    from mpc_cover.planning.task import Task

_WIDE_TURN, _NARROW_TURN = 1.0, 0.3
"""Distances to stop, in sensing radii: beyond the first, turns are too wide for sweeps at full speed; with the second,
at the slowest speed that is tried, they fit. Plain choices."""
_LONG_STEP, _SHORT_STEP = 2.0, 0.7
"""Lengths of a step, in sensing radii, likewise."""
_LOOK_STEP = 1.4
"""Distance between looks, in sensing radii, that sweeps most in a time: sqrt(2), at which the swath is as wide."""
_SPEEDS = 4
"""Speeds that are compared; a plain choice."""
_LEFT_COST = 5.0
"""Cost of a part of the demand that is left, in parts of the duration; a plain choice: what is left lies scattered."""
_SWEEPS = frozenset({GuessKind.COMB, GuessKind.SNAKE, GuessKind.STRIPS})


def at_cruise(task: Task, guesses: Iterator[Guess]) -> Iterator[Guess]:
    """Yield guesses, of sweeps those at the best of several speeds where full speed is too fast for turns or looks."""
    speeds = cruise_speeds(task)
    full = len(speeds) == 1 and bool((speeds[0] >= task.fleet.speed_max).all())
    for guess in guesses:
        yield guess if full or guess.origin.kind not in _SWEEPS else _best_speed(task, guess, speeds)


def cruise_speeds(task: Task) -> list[FloatArray]:
    """Return the speeds (m,) [m/s] that are worth comparing, the fastest first; one where that is slow enough."""
    fleet, instants = task.fleet, task.fleet.look_instants
    radius = np.where(np.isfinite(fleet.radius), fleet.radius, np.inf).min(axis=1)
    able = np.isfinite(radius)
    fastest = fleet.speed_max.copy()
    if not able.any():
        return [fastest]
    radius = np.where(able, radius, radius[able].min())
    if not instants.continuous:
        fastest = np.minimum(fastest, _LOOK_STEP * radius * instants.per_step / task.period)
    turn, step = fastest**2 / (2.0 * fleet.input_max), fastest * task.period
    if not (turn > _WIDE_TURN * radius).any() and not (step > _LONG_STEP * radius).any():
        return [fastest]
    by_turn = np.sqrt(2.0 * fleet.input_max * _NARROW_TURN * radius)
    slowest = np.minimum(fastest, np.minimum(by_turn, _SHORT_STEP * radius / task.period))
    return [fastest * (slowest / fastest) ** part for part in np.linspace(0.0, 1.0, _SPEEDS)]


def _best_speed(task: Task, guess: Guess, speeds: list[FloatArray]) -> Guess:
    """Return a guess with the speed at which it covers most for its duration."""

    def cost(tried: Guess) -> float:
        motion = task.flown(tried, None)
        left = float((task.remaining_after(motion) > 0.0).sum()) / max(float((task.weight > 0.0).sum()), 1.0)
        return motion.steps * (1.0 + _LEFT_COST * left)

    return min((replace(guess, cruise=speed) for speed in speeds), key=cost)
