"""Capabilities and costs of a back-end, by which callers decide instead of by its name.

All numbers are measured, on the QPs of the mission box-3 (27 samples, three agents, 64-bit, one thread on a core at
about 2.5 GHz) in refining plans from six initial guesses; each back-end's module gives the figures.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from solvers.qp import QP


@dataclass(frozen=True)
class Capabilities:
    """Capabilities and costs of a back-end.

    Attributes
    ----------
    second_order_cones: whether it takes a `QP` with cones.
    inexact: the loosest tolerance that suffices for subproblems far from the solution of an SQP.
    fine: the loosest tolerance beyond which a tighter one no longer improves the SQP's solution.
    accurate: the tightest tolerance that it reaches on every QP within its default number of iterations and in
        reasonable time.
    entry_iteration_s: time of an iteration per stored entry of A [s].
    variables_max: the most variables of a QP that it is given; it has been seen to bear about so many.
    whole_problem: whether `solvers.native` descends on the whole problem in its place, where it can.
    """

    second_order_cones: bool
    inexact: float
    fine: float
    accurate: float
    entry_iteration_s: float
    variables_max: int = 100_000
    whole_problem: bool = False

    def __post_init__(self) -> None:
        """Raise `ValueError` for non-positive numbers, or tolerances in the wrong order."""
        if not 0.0 < self.accurate <= self.fine <= self.inexact < math.inf:
            raise ValueError(f"0 < accurate <= fine <= inexact is wanted, got {self}")
        if not 0.0 < self.entry_iteration_s < math.inf:
            raise ValueError(f"entry_iteration_s must be positive and finite, got {self.entry_iteration_s}")

    def bears(self, qp: QP) -> bool:
        """Return whether a QP is one of those that the back-end may be given, by its size and its cones."""
        return qp.n <= self.variables_max and (self.second_order_cones or qp.cones is None)
