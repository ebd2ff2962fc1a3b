"""How a fleet flies by the potential law (chapters 5 and 6), as the user writes it."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BeforeValidator, Field

from mpc_cover.mission.base import Model, NonNegative, Positive, no_flag

MAX_DELAY = 1000

Steep = Annotated[float, Field(gt=1, le=20, allow_inf_nan=False), BeforeValidator(no_flag)]
Samples = Annotated[int, Field(ge=0, le=MAX_DELAY), BeforeValidator(no_flag)]


class PotentialSpec(Model):
    """The law's tuning; what is left out follows from the fleet, in the proportions of the thesis.

    u_max of (5.2) is each agent's `speed_max_m_per_s`, T_s is `control.period_s`, rho_B and rho_C are the fleet's.
    """

    alpha: Steep = 4.0
    """Exponent with which the attraction of a cell falls with its distance (5.9)."""
    core_m: Positive | None = None
    """beta^(1/alpha) of (5.9): within it a cell does not attract; left out, half the smallest sensing radius."""
    gain_m2_per_s: Positive | None = None
    """K of (5.16), for each unit of residual information; left out, agents fly at u_max along the gradient."""
    coordination_gain_m2_per_s: NonNegative | None = None
    """Of the potentials of (6.1) and (6.5); left out, a tenth of the smallest sensing radius squared a second."""
    random_part: Annotated[float, Field(ge=0, le=1, allow_inf_nan=False), BeforeValidator(no_flag)] = 0.1
    """The random signal of (5.17), as a part of u_max."""
    repel_within_m: Positive | None = None
    """R_B of (6.1); left out, 2 rho_B."""
    attract_beyond_m: Positive | None = None
    """R_C of (6.5); left out, 8/11 rho_C."""
    spare_edges: bool = True
    """Whether agents without a controller also keep edges that leave the others connected when any one is lost."""
    delay_samples: Samples | Literal["hops"] = "hops"
    """delta of 6.3: how late agents know of each other; hops: as late as messages arrive, one hop a sample."""
    patience_s: Positive = 10.0
    """Time without a change of the map after which an agent attends to one cell only (lemma 6.2.1)."""
    lost_after_samples: Annotated[int, Field(ge=2, le=MAX_DELAY), BeforeValidator(no_flag)] | None = None
    """Samples of silence after which a neighbour is lost; left out, four more than it takes to brake."""
