"""The problem of a benchmark: a mission's NLP (4.22, 4.34), and the guesses that all peers start from."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING, assert_never

import numpy as np

from mpc_cover.constraints.graph import minimum_spanning_trees
from mpc_cover.constraints.pairs import all_pairs, linked_pairs
from mpc_cover.planning.initial_guess.boustrophedon import Boustrophedon
from mpc_cover.planning.initial_guess.guess import rest_guess
from mpc_cover.planning.ocp import Margins, Requirements, requirements
from mpc_cover.planning.offline import offline_task

if TYPE_CHECKING:
    from mpc_cover.arrays import BoolArray, FloatArray
    from mpc_cover.mission.load import Mission
    from mpc_cover.planning.ocp import OCP
    from mpc_cover.planning.task import Task


class Guess(StrEnum):
    """The initial guesses of a benchmark."""

    BOUSTROPHEDON = "boustrophedon"
    """Strips of equal work, flown to and fro."""
    REST = "rest"
    """All agents stand still."""


_DURATION_S = 15.0
"""Duration of the plans that are compared where the mission gives none; a plain choice."""


@dataclass(frozen=True, eq=False)
class Case:
    """A mission over its `planning.duration_s`, or 15 s where it gives none.

    Attributes
    ----------
    mission : by whose limits the verifier judges all peers.
    task, ocp : the same for the planner. Peers return decision vectors of `ocp`: the position at sample 0 and all
        velocities, so that the dynamics hold exactly for all.
    """

    mission: Mission
    task: Task
    ocp: OCP

    def time(self) -> FloatArray:
        """Return the (N+1,) sample times [s]."""
        return self.ocp.period * np.arange(self.ocp.steps + 1, dtype=float)


def make_case(mission: Mission) -> Case:
    """Return the problem that `mpc-cover plan` solves for this mission."""
    task = offline_task(mission)
    duration_s = mission.spec.planning.duration_s or _DURATION_S
    return Case(mission, task, task.ocp(round(duration_s / task.period)))


def start_from(case: Case, guess: Guess) -> FloatArray:
    """Return the decision vector of a guess."""
    task = case.task
    match guess:
        case Guess.REST:
            chosen = rest_guess(task.position)
        case Guess.BOUSTROPHEDON:
            chosen = next(Boustrophedon().guesses(task))
        case _:
            assert_never(guess)
    return case.ocp.decision_of(task.flown(chosen, case.ocp.steps))


def held_edges(case: Case, position: FloatArray) -> BoolArray:
    """Return (samples, pairs) that peers hold within range at the samples that are not given.

    They are the links, and the minimum spanning trees of the motion (N+1, m, d) [m]; none where no range is asked for.
    """
    fleet = case.ocp.fleet
    one, two = all_pairs(fleet.size)
    sampled = position[case.ocp.first :]
    length = np.linalg.norm(sampled[:, one] - sampled[:, two], axis=2)
    if fleet.size == 1 or not np.isfinite(fleet.communication_range):
        return np.zeros(length.shape, dtype=bool)
    held = minimum_spanning_trees(length, fleet.size)
    held[:, linked_pairs(fleet.size, fleet.links)] = True
    return held


def asked_of_peers(case: Case) -> Requirements:
    """Return the distances that peers are asked to keep at the samples (4.18 to 4.20): least (pairs,) and range [m].

    They are rho_B and rho_C with the same margins that our own plans keep for the path between two samples
    (a_rel T_s^2 / 8). Without them peers gave plans that hold at the samples only and cannot be flown; with them
    their J hardly suffers, and most of their plans hold along the path as well.
    """
    ocp, fleet = case.ocp, case.ocp.fleet
    required = requirements(ocp, Margins())
    if fleet.size == 1:
        return required
    one, two = all_pairs(fleet.size)
    between = (fleet.input_max[one] + fleet.input_max[two]) * ocp.period**2 / 8.0
    separation, reach = required.separation + between, required.range - 0.5 * float(between.max())
    for given in (ocp.ends.start_position, ocp.ends.end_position):
        if given is not None:  # no peer is asked for more than its given ends allow
            here = np.linalg.norm(given[one] - given[two], axis=1)
            separation = np.maximum(required.separation, np.minimum(separation, here))
    return Requirements(separation, reach)
