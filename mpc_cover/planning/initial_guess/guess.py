"""An initial guess of a motion, and where it comes from."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray
    from mpc_cover.model.trajectory import Trajectory


class GuessKind(Enum):
    """The generator of a guess."""

    COMB = "agents abreast, lane by lane"
    SNAKE = "one path through all lanes, cut into pieces"
    STRIPS = "a strip of equal work for each agent"
    PARTS = "a part of its own for each agent of a large fleet, all in the same pattern"
    SHAPE = "one path along the shape, divided"
    SHAPE_APART = "the same, farther apart than the communication range"
    TOUR = "a greedy tour from cell to cell"
    REST = "all agents rest"
    TIMED_SWEEP = "a sweep timed by a linear programme for many looks"
    FORMATION = "the fleet moves as one body"
    RENDEZVOUS = "groups out of range of each other meet"
    REPAIR = "the paths of an earlier plan, then a tour of the remaining cells"
    GIVEN = "given by the caller"


class Origin(NamedTuple):
    """The origin of a plan: the kind of its initial guess, and a name that is unique within the kind."""

    kind: GuessKind
    name: str


@dataclass(frozen=True, eq=False)
class Guess:
    """Waypoints to track, or a motion.

    Attributes
    ----------
    origin : kind and name.
    paths : waypoints of each agent, (W_i, d) [m]; empty where there is a motion.
    motion : a motion with its own timing; None where waypoints are given.
    cruise : (m,) [m/s] at which waypoints are tracked, no faster than the agents' limits; None for those.
    """

    origin: Origin
    paths: list[FloatArray] = field(default_factory=list)
    motion: Trajectory | None = None
    cruise: FloatArray | None = None


def rest_guess(position: FloatArray) -> Guess:
    """Return the guess that rests at (m, d) positions [m], which is always feasible."""
    return Guess(Origin(GuessKind.REST, "rest"), [here[None] for here in position])
