"""J (4.34) as CasADi expressions, for solvers that differentiate by themselves.

Written as a few operations on whole (cells, samples) matrices: on box-3 CasADi evaluates the gradient in 2 ms, a
sixth of what it takes with a graph of scalars mapped over the cells.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import casadi as cs
import numpy as np

if TYPE_CHECKING:
    from mpc_cover.arrays import IntArray
    from mpc_cover.studies.case import Case

_ROUND = 1e-8
"""Added to squared distances [m^2]: the norm has no gradient at 0."""


@dataclass(frozen=True, eq=False)
class Excess:
    """What one magnitude takes the minimum of: K cells, S samples of those who can measure it.

    Attributes
    ----------
    value : (K, S) distance - rho [m].
    distance : (K, S) [m].
    direction : for each axis, (K, S) unit vectors from cell to sample.
    weight : (K, 1) gamma.
    sample : (S,) columns of the fleet's points.
    """

    value: Any
    distance: Any
    direction: list[Any]
    weight: Any
    sample: IntArray


def excesses(case: Case, points: Any) -> list[Excess]:
    """Return the excesses over the (d, (N+1) m) points of the fleet, sample by sample and agent by agent.

    Raises
    ------
    NotImplementedError
        Cells are owed several looks.
    """
    ocp, parts = case.ocp, []
    if ocp.looks is not None:
        raise NotImplementedError("a cost of several looks at a cell is not written for CasADi")
    fleet, samples = ocp.fleet, ocp.steps + 1
    for magnitude in range(fleet.radius.shape[1]):
        live = np.flatnonzero(ocp.weight[magnitude] > 0.0)
        able = np.flatnonzero(np.isfinite(fleet.radius[:, magnitude]))
        if live.size == 0:
            continue
        sample = (np.arange(samples)[:, None] * fleet.size + able).ravel()
        reach = np.tile(fleet.radius[able, magnitude], (live.size, samples))
        difference = [
            cs.repmat(points[axis, sample.tolist()], live.size, 1)
            - cs.repmat(cs.DM(ocp.cell[live, axis]), 1, sample.size)
            for axis in range(fleet.dimension)
        ]
        distance = cs.sqrt(sum(part**2 for part in difference) + _ROUND)
        weight = cs.DM(ocp.weight[magnitude, live])
        parts.append(
            Excess(distance - cs.DM(reach), distance, [part / distance for part in difference], weight, sample)
        )
    return parts


def row_minimum(matrix: Any) -> Any:
    """Return (K, 1): the minimum of each row, by halving (mmin takes that of a whole matrix)."""
    while (columns := matrix.shape[1]) > 1:
        half = columns // 2
        rest = [matrix[:, columns - 1]] if columns % 2 else []
        matrix = cs.horzcat(cs.fmin(matrix[:, :half], matrix[:, half : 2 * half]), *rest)
    return matrix


def hard_cost(parts: list[Excess], margin: Any) -> Any:
    """Return J with its minimum as it is, every radius shortened by `margin` [m]."""
    return sum(cs.dot(part.weight, cs.fmax(row_minimum(part.value) + margin, 0.0)) for part in parts)


def soft_cost(parts: list[Excess], beta: Any, margin: Any) -> Any:
    """Return J with log-sum-exp for the minimum and softplus for pos, both of sharpness `beta` [1/m]."""
    total = cs.MX(0.0)
    for part in parts:
        level, _ = _soft_minimum(part, beta)
        level = level + margin
        softplus = cs.fmax(level, 0.0) + cs.log1p(cs.exp(-beta * cs.fabs(level))) / beta
        total = total + cs.dot(part.weight, softplus)
    return total


def soft_hessian(parts: list[Excess], beta: Any, margin: Any, points: int) -> Any:
    """Return the Hessian of `soft_cost` over `points` points, coordinate by coordinate of each.

    With e_n = ||q_n - p|| - rho, r_n the unit vector, w the softmax and s the sigmoid of beta level:
    sum gamma s (beta (1 - s) + beta) g g' + blocks of gamma s w ((I - r r') / d - beta r r'),  g = (w_n r_n).
    CasADi's own differentiation takes a sweep for each column: nine times as long on box-3.
    """
    total = cs.MX(0.0)
    for part in parts:
        level, share = _soft_minimum(part, beta)
        columns, axes = part.value.shape[1], len(part.direction)
        decay = cs.exp(-beta * cs.fabs(level + margin))
        active = cs.if_else(level + margin > 0.0, 1.0, decay) / (1.0 + decay)
        gradient = cs.horzcat(*(share * direction for direction in part.direction))
        rank_one = part.weight * active * beta * (2.0 - active)
        dense = cs.mtimes(gradient.T, cs.repmat(rank_one, 1, axes * columns) * gradient)
        pull = cs.repmat(part.weight * active, 1, columns) * share
        blocks = [
            [cs.diag(cs.sum1(_bend(part, pull, beta, a, b)).T) for b in range(axes)]  # by axis, then by sample
            for a in range(axes)
        ]
        place = _placing(part.sample, points, axes)
        total = total + cs.mtimes([place, dense + cs.blockcat(blocks), place.T])
    return total


def _bend(part: Excess, pull: Any, beta: Any, a: int, b: int) -> Any:
    """Return (K, S): the terms of a block's entry (a, b)."""
    product = part.direction[a] * part.direction[b]
    return pull * (((1.0 if a == b else 0.0) - product) / part.distance - beta * product)


def _soft_minimum(part: Excess, beta: Any) -> tuple[Any, Any]:
    """Return softmin_beta of each row (K, 1) [m] and its weights (K, S), without overflow."""
    columns = part.value.shape[1]
    least = row_minimum(part.value)
    powers = cs.exp(-beta * (part.value - cs.repmat(least, 1, columns)))
    total = cs.sum2(powers)
    return least - cs.log(total) / beta, powers / cs.repmat(total, 1, columns)


def _placing(sample: IntArray, points: int, axes: int) -> Any:
    """Return the matrix that takes entries ordered by axis, then sample, to the coordinates of all points."""
    row = (sample[None] * axes + np.arange(axes)[:, None]).ravel()
    return cs.DM.triplet(row.tolist(), list(range(row.size)), cs.DM.ones(row.size), points * axes, row.size)
