"""One problem for everyone: a mission's NLP (4.22, 4.34), and the guesses that all peers start from."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.constraints.pairs import all_pairs
from mpc_cover.errors import UserError
from mpc_cover.planning.initial_guess.boustrophedon import Boustrophedon
from mpc_cover.planning.initial_guess.guess import rest_guess
from mpc_cover.planning.ocp import Margins, Requirements, requirements
from mpc_cover.planning.offline import offline_task

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray
    from mpc_cover.mission.load import Mission
    from mpc_cover.planning.ocp import OCP
    from mpc_cover.planning.task import Task

GUESSES = ("boustrophedon", "rest")
"""What a benchmark may start from: strips of equal work, flown to and fro; or standing still."""


@dataclass(frozen=True, eq=False)
class Case:
    """A mission over its `planning.duration_s`.

    Attributes
    ----------
    mission : whose limits the verifier holds everyone to.
    task, window : the same as the planner sees it. Peers hand over decision vectors of `ocp`: the
        position at sample 0 and all velocities, so that the dynamics hold exactly for everyone.
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
    return Case(mission, task, task.ocp(round(mission.spec.planning.duration_s / task.period)))


def start_from(case: Case, guess: str) -> FloatArray:
    """Return the decision vector of a guess by name.

    Raises
    ------
    UserError
        For a name that is not in `GUESSES`.
    """
    task = case.task
    if guess == "rest":
        chosen = rest_guess(task.position)
    elif guess == "boustrophedon":
        chosen = next(Boustrophedon().guesses(task))
    else:
        raise UserError(f"--guess {guess}: is none: must be one of {', '.join(GUESSES)} or all")
    return case.ocp.decision_of(task.flown(chosen, case.ocp.steps))


def asked_of_peers(case: Case) -> Requirements:
    """Return the distances that peers are asked to keep at the samples (4.18 to 4.20): least (pairs,) and range [m].

    They are rho_B and rho_C with just the margins that our own plans keep, in which a path between two samples
    finds room (a_rel T_s^2 / 8). Peers measured at the samples only, without them, gave plans that no peer's
    user could fly; with them their J hardly suffers, and most of their plans hold along the path as well.
    """
    ocp, fleet = case.ocp, case.ocp.fleet
    required = requirements(ocp, Margins())
    if fleet.size == 1:
        return required
    one, two = all_pairs(fleet.size)
    between = (fleet.input_max[one] + fleet.input_max[two]) * ocp.period**2 / 8.0
    separation, reach = required.separation + between, required.range - 0.5 * float(between.max())
    for given in (ocp.ends.start_position, ocp.ends.end_position):
        if given is not None:  # no peer is asked for more room than it is given
            here = np.linalg.norm(given[one] - given[two], axis=1)
            separation = np.maximum(required.separation, np.minimum(separation, here))
    return Requirements(separation, reach)
