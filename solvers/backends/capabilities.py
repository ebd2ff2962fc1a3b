"""What a back-end can do and what that costs: callers ask for this, never for its name.

Every number is measured, not guessed, on the QPs of the mission box-3 (27 samples, three agents, 64-bit, one thread
on a core at 2.5 GHz or so), from the plans that six guesses lead to; each back-end's file gives the figures.
"""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class Capabilities:
    """What a back-end can do and what that costs.

    Attributes
    ----------
    second_order_cones: whether it takes a `QP` with cones.
    inexact: the loosest tolerance that does for subproblems far from the solution of an SQP.
    fine: the loosest tolerance from which on a tighter one makes the SQP's solution no better.
    accurate: the tightest tolerance that it reaches on every QP within its default number of iterations, and in
        reasonable time.
    entry_iteration_s: seconds that an iteration takes for each stored entry of A.
    """

    second_order_cones: bool
    inexact: float
    fine: float
    accurate: float
    entry_iteration_s: float

    def __post_init__(self) -> None:
        """Raise `ValueError` for numbers that mean nothing, or tolerances in the wrong order."""
        if not 0.0 < self.accurate <= self.fine <= self.inexact < math.inf:
            raise ValueError(f"0 < accurate <= fine <= inexact is wanted, got {self}")
        if not 0.0 < self.entry_iteration_s < math.inf:
            raise ValueError(f"entry_iteration_s must be positive and finite, got {self.entry_iteration_s}")
