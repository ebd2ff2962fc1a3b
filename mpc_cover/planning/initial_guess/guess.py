"""A guess: where a search starts from."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray
    from mpc_cover.model.trajectory import Trajectory


class GuessKind(Enum):
    """What a guess is made by."""

    COMB = "agents abreast, lane by lane"
    SNAKE = "one path through all lanes, cut into pieces"
    STRIPS = "a strip of equal work for each agent"
    TOUR = "a greedy tour from cell to cell"
    REST = "everyone stays"
    TIMED_SWEEP = "a sweep timed by a linear programme for many looks"
    FORMATION = "the fleet moves as one body"
    RENDEZVOUS = "groups out of range of each other meet"
    REPAIR = "the ways of an earlier plan, then what is left over"
    GIVEN = "handed in from outside"


class Origin(NamedTuple):
    """Where a plan comes from: the kind of its guess, and a name that tells it from others of its kind."""

    kind: GuessKind
    name: str


@dataclass(frozen=True, eq=False)
class Guess:
    """Waypoints to be tracked, or a motion.

    Attributes
    ----------
    origin : what it is.
    paths : for each agent (W_i, d) [m]; empty where there is a motion.
    motion : the motion itself, with its own timing; None where waypoints are given.
    """

    origin: Origin
    paths: list[FloatArray] = field(default_factory=list)
    motion: Trajectory | None = None


def rest_guess(position: FloatArray) -> Guess:
    """Return the guess that stays at (m, d) positions [m]: always feasible."""
    return Guess(Origin(GuessKind.REST, "rest"), [here[None] for here in position])
