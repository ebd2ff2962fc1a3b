"""Plans that bring several looks at once: sweeps flown as slowly as it takes, instead of again and again.

Each guess is timed by a linear programme (`dwelling`), flown within the limits, and judged. What whole samples lack
is asked for once more of the programme; what breaks separation or connectivity is left to the SQP.
"""

from __future__ import annotations

from itertools import islice
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.model.sensing import look_counts
from mpc_cover.planning.deadline import late
from mpc_cover.planning.dwelling import dwell, timed
from mpc_cover.planning.follow import follow_samples
from mpc_cover.planning.guesses import Guess, sweep_guesses
from mpc_cover.planning.task import as_flown

if TYPE_CHECKING:
    from collections.abc import Iterator

    from mpc_cover.arrays import IntArray
    from mpc_cover.planning.follow import Motion
    from mpc_cover.planning.task import Candidate, Task

_ROUNDS = 4
"""How often the programme is asked again for what whole samples lack."""

AT_ONCE = 3
"""Looks at a cell that fast passes bring in one lap: with four agents planning takes twice as long for each more."""


def takes_laps(looks: IntArray | None) -> bool:
    """Return whether so many looks (J, K) are owed that plans which pass by as fast as they can need several laps."""
    return looks is not None and int(looks.max(initial=0)) > AT_ONCE


def unhurried(task: Task, most: int, deadline: float | None = None) -> list[Candidate]:
    """Return what up to `most` sweeps come to that are flown so that every cell gets all the looks it is owed.

    For tasks of several looks from a given start to rest; one at the least, whatever the `deadline`.
    """
    found: list[Candidate] = []
    guesses = sweep_guesses(task.fleet, task.cell, task.weight, task.position, task.period)
    for guess in islice(guesses, most):
        if found and late(deadline):
            break
        for motion in _flown(task, guess):
            found.append(as_flown(task, Guess(f"slow {guess.kind}", guess.paths), motion))
            if found[-1].cost == 0.0 or late(deadline):
                break
    return found


def _flown(task: Task, guess: Guess) -> Iterator[Motion]:
    """Yield the motions of a guess, each timed for what the one before lacks."""
    assert task.looks is not None
    paths = [np.concatenate([here[None], path]) for here, path in zip(task.position, guess.paths, strict=True)]
    owed = np.where(task.weight > 0.0, task.looks, 0).astype(float)
    asked = owed.copy()
    for _ in range(_ROUNDS):
        found = dwell(paths, task.fleet, task.cell, asked, task.period)
        if found is None:
            return
        steps = int(np.ceil(max(float(samples.sum()) for samples in found.samples) - 1e-9)) + 1
        motion = follow_samples(timed(found, steps), task.position, task.velocity, task.fleet, task.period)
        yield motion
        lacking = np.maximum(owed - look_counts(motion.position, task.cell, task.fleet.radius), 0.0)
        asked = np.where(lacking > 0.0, asked + lacking, asked)
