"""Parameters of an agent that runs the distributed law by itself."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mpc_cover.distributed.potential_law import LawParameters


@dataclass(frozen=True)
class AgentParameters:
    """How an agent runs the law.

    Attributes
    ----------
    law : its tuning; the edges kept are always the choice of the agent itself, for which it needs no message.
    period_s : T_s.
    patience : samples without a change of the map after which one cell counts only (`stall_escape`).
    lost_after : samples of silence after which a neighbour is taken for lost; it must be at rest by then.
    lost_margin_m : how far a lost agent may be outside its stopping balls. 0 where silence means that its process has
        ended and it braked; where a radio may fail one way, it had two more samples to act: 2 T_s v_max and the
        braking distance.
    delay : samples by which other agents' looks are held back at the least (delta of 6.3); 0 for none.
    """

    law: LawParameters
    period_s: float
    patience: int = 20
    lost_after: int = 6
    lost_margin_m: float = 0.0
    delay: int = 0
