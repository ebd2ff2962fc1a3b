"""Separation from every plan that an agent may hold: what keeps a fleet apart whatever messages are lost.

An agent flies one of the plans that it was sent since its last report, and nobody knows which. A new plan is admitted
only if each agent's part keeps away from all plans that each other agent may hold, up to their ends at rest. By
induction all plans that are held are apart at any time, in any combination: an agent that misses messages finishes its
plan, and nobody is sent into its way. With everyone's reports in, that is one plan each.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from mpc_cover.verification.path import Path
from mpc_cover.verification.separation import are_far_apart, smallest_separations
from mpc_cover.verification.tolerance import tolerance_of

if TYPE_CHECKING:
    from collections.abc import Iterable

    from mpc_cover.arrays import FloatArray, IntArray
    from mpc_cover.model.fleet_constraints import FleetConstraints
    from mpc_cover.model.fleet_state import FleetState
    from mpc_cover.model.trajectory import Trajectory

_SAME_TIME_S = 1e-9
"""Samples closer than this are one [s]; a plain choice."""


def separation_from_held(plan: Trajectory, state: FleetState) -> FloatArray:
    """Return (m, m) [m]: how near each agent's part of a plan comes to the plans that each other agent may hold.

    inf where nothing is held, on the diagonal, and for parts of lost agents, which are not sent any.
    """
    pairs = _pairs(state)
    least = np.full((state.lost.size, state.lost.size), np.inf)
    return least if pairs is None else _least(_beside(plan, state), pairs, least)


class _Pairs(NamedTuple):
    """(P,) who flies a new plan, the column of `_beside` of what another agent may hold, and which agent that is."""

    flying: IntArray
    column: IntArray
    owner: IntArray


def _pairs(state: FleetState) -> _Pairs | None:
    """Return who may meet which held motion of another; None where there are none."""
    owners = np.array([index for index, motions in sorted(state.held.items()) for _ in motions], dtype=np.intp)
    flying, held = np.meshgrid(np.flatnonzero(~state.lost), np.arange(owners.size), indexing="ij")
    other = flying != owners[held]
    return _Pairs(flying[other], state.lost.size + held[other], owners[held[other]]) if other.any() else None


def _least(path: Path, pairs: _Pairs, least: FloatArray) -> FloatArray:
    """Return `least` (m, m) [m] with the smallest distances of the pairs in it."""
    np.minimum.at(least, (pairs.flying, pairs.owner), smallest_separations(path, (pairs.flying, pairs.column)))
    return least


def _beside(plan: Trajectory, state: FleetState) -> Path:
    """Return the path of a plan (m agents), and beside it that of each of the held motions, until all are at rest."""
    motions = [motion for _, several in sorted(state.held.items()) for motion in several]
    begin, end = plan.start_time, max([plan.end_time, *(motion.end_time for motion in motions)])
    every = np.concatenate([plan.time, *(motion.time for motion in motions), [end]])
    every = np.unique(every[(every >= begin) & (every <= end)])
    every = every[np.append(True, np.diff(every) > _SAME_TIME_S)]
    position, velocity = plan.at(every, _SAME_TIME_S)
    force = plan.input_at(every, _SAME_TIME_S)
    parts = [(position, velocity, force)]
    for motion in motions:
        there, now = motion.at(every, _SAME_TIME_S)
        parts.append((there[:, None], now[:, None], motion.input_at(every, _SAME_TIME_S)[:, None]))
    position, velocity, force = (np.concatenate(arrays, axis=1) for arrays in zip(*parts, strict=True))
    return Path(every, position, velocity, force[:-1])


def crossing(
    plan: Trajectory,
    state: FleetState,
    fleet: FleetConstraints,
    known: Iterable[Trajectory],
    *,
    eased: bool = False,
) -> str | None:
    """Return where a plan comes nearer to what another agent may hold than rho_B, in words; None where nowhere.

    Where even the best of the `known` motions comes as near, one of which is flown otherwise, that is no reason to
    refuse a plan. Fleets that are too tight for it are `eased`: then everyone must have reported what it flies.
    """
    if eased:
        return None if state.acknowledged else "some agent may hold several plans, and there is no room for that"
    pairs, asked = _pairs(state), _asked(fleet)
    if pairs is None:
        return None
    path = _beside(plan, state)
    if are_far_apart(path, (pairs.flying, pairs.column), asked[pairs.flying, pairs.owner]):
        return None
    least = _least(path, pairs, np.full(asked.shape, np.inf))
    near = least < asked
    if not near.any():
        return None
    attained = [separation_from_held(motion, state) for motion in known]
    best = max(attained, key=lambda there: float((there - asked).min()), default=None)
    if best is not None and (best < asked).any() and (least >= np.minimum(asked, best - tolerance_of(fleet))).all():
        return None
    one, other = np.unravel_index(int(np.argmin(np.where(near, least - asked, np.inf))), least.shape)
    return f"{least[one, other]:.3g} m between {fleet.ids[one]} and a plan that {fleet.ids[other]} may hold"


def _asked(fleet: FleetConstraints) -> FloatArray:
    """Return (m, m) [m]: the distances that are required."""
    asked = np.zeros((fleet.size, fleet.size))
    one, two = np.triu_indices(fleet.size, k=1)
    asked[one, two] = asked[two, one] = fleet.separations - tolerance_of(fleet)
    return asked
