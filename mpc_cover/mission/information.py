"""When a cell counts as measured, as the user writes it (5.2.1, chapter 7): `information: {kind: ...}`.

Magnitudes are in their own unit, variances in its square.
"""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated, Literal

from pydantic import BeforeValidator, Field

from mpc_cover.mission.base import Finite, Model, Positive, no_flag

Seed = Annotated[int, Field(ge=0, le=2**32 - 1), BeforeValidator(no_flag)]


class InformationKind(StrEnum):
    """The kinds of information by their names in mission files and summaries."""

    COVERAGE = "coverage"
    LOOKS = "looks"
    EFFECTIVE = "effective"
    KALMAN = "kalman"
    AGEING = "ageing"


class CoverageFunction(StrEnum):
    """The instantaneous coverage function A of effective coverage."""

    CONSTANT = "constant"
    """The same in the whole disc: `peak`."""
    BUMP = "bump"
    """Falls smoothly from `peak` at the agent to `rim` at its radius."""


class CoverageInformation(Model):
    """One look settles a cell; with `area.looks: K`, K looks."""

    kind: Literal["coverage"]


class LookInformation(Model):
    """K-coverage: a number of looks settles a cell; looks of one agent at the same cell count a period apart."""

    kind: Literal["looks"]
    looks: Annotated[int, Field(ge=1, le=100), BeforeValidator(no_flag)]


class EffectiveInformation(Model):
    """Effective coverage: each look adds A(distance), and a cell is settled once their sum reaches C*."""

    kind: Literal["effective"]
    level: Positive
    """C*."""
    function: CoverageFunction = CoverageFunction.BUMP
    """A."""
    peak: Positive = 1.0
    rim: Positive | None = None
    """What a bump adds at the sensing radius; must be positive (5.2.1). Left out, a tenth of `peak`."""

    @property
    def least(self) -> float:
        """What a look adds at least."""
        if self.function is CoverageFunction.CONSTANT:
            return self.peak
        return 0.1 * self.peak if self.rim is None else self.rim


class TrueField(Model):
    """The field that simulated sensors read: smooth, a sum of random bumps up and down."""

    kind: Literal["bumpy"] = "bumpy"
    seed: Seed = 0
    """Of the bumps, and of the noise of the readings."""
    bumps: Annotated[int, Field(ge=1, le=100), BeforeValidator(no_flag)] = 5
    amplitude: Positive = 3.0
    """Height of the highest possible bump, in the magnitude's unit."""


class KalmanInformation(Model):
    """Stochastic coverage: a Kalman filter for each cell, settled once its variance is at most P_max (5.6 to 5.8)."""

    kind: Literal["kalman"]
    noise_variance: Positive
    """R of every sensor, in the magnitude's unit squared."""
    prior_variance: Positive
    """P before the first look."""
    target_variance: Positive
    """P_max: what the variance of each cell must fall to."""
    prior_mean: Finite = 0.0
    """Estimate before the first look."""
    field: TrueField = TrueField()


class AgeingInformation(Model):
    """A patrol: a look is valid for a while, then the cell is owed one again. Goes on until `control.time_limit_s`."""

    kind: Literal["ageing"]
    age_limit_s: Positive
    """How long a look is as good as new [s]."""
    growth_per_s: Positive = 1.0
    """By how much the residual information grows in a second beyond that."""
    strict: bool = False
    """Whether a flight on which a look gets older than that fails its verification; else its age is only reported."""


Information = Annotated[
    CoverageInformation | LookInformation | EffectiveInformation | KalmanInformation | AgeingInformation,
    Field(discriminator="kind"),
]
