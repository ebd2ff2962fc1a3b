"""Validation of a mission's `information`."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from mpc_cover.errors import Problem
from mpc_cover.mission.information import (
    AgeingInformation,
    CoverageFunction,
    EffectiveInformation,
    KalmanInformation,
    LookInformation,
)

if TYPE_CHECKING:
    from collections.abc import Iterator

    from mpc_cover.mission.config import MissionSpec

MOST_LOOKS = 100
"""No cell may need more looks."""


def information_problems(spec: MissionSpec) -> Iterator[Problem]:
    """Yield what is wrong with `information`, by itself and beside `area.looks`."""
    given, looks = spec.information, spec.area.looks
    if isinstance(given, LookInformation):
        if looks not in (1, given.looks):
            right = f"contradicts area.looks {looks}: give one of the two, or the same number"
            yield Problem("information.looks", given.looks, right)
    elif looks > 1 and isinstance(given, EffectiveInformation | KalmanInformation | AgeingInformation):
        right = f"must be left out: information of kind {given.kind} says itself when a cell is measured"
        yield Problem("area.looks", looks, right)
    if isinstance(given, EffectiveInformation):
        yield from _effective_problems(given)
    elif isinstance(given, KalmanInformation):
        yield from _kalman_problems(given)
    elif isinstance(given, AgeingInformation) and given.age_limit_s < spec.control.period_s:
        right = f"must be at least period_s {spec.control.period_s}: agents look once a period"
        yield Problem("information.age_limit_s", given.age_limit_s, right)


def _effective_problems(given: EffectiveInformation) -> Iterator[Problem]:
    if given.function is CoverageFunction.CONSTANT and given.rim is not None:
        yield Problem("information.rim", given.rim, "must be left out: a constant function has none")
        return
    if given.least > given.peak:
        yield Problem("information.rim", given.rim, f"must be at most peak {given.peak}")
    if (needed := math.ceil(given.level / given.least - 1e-9)) > MOST_LOOKS:
        right = f"needs up to {needed} looks that add {given.least:g} each, must need at most {MOST_LOOKS}"
        yield Problem("information.level", given.level, right)


def _kalman_problems(given: KalmanInformation) -> Iterator[Problem]:
    target, prior = given.target_variance, given.prior_variance
    if target >= prior:
        right = f"must be less than prior_variance {prior}: nothing would be owed"
        yield Problem("information.target_variance", target, right)
    elif (needed := math.ceil(given.noise_variance * (1.0 / target - 1.0 / prior) - 1e-9)) > MOST_LOOKS:
        right = f"needs {needed} looks with noise_variance {given.noise_variance}, must need at most {MOST_LOOKS}"
        yield Problem("information.target_variance", target, right)
