"""The convex majoriser of the coverage objective: its soft minimum, linearised, with the curvature of the distances.

softmin_b(e) = -(1/b) log sum exp(-b e_n) is concave in the excesses e_n = d_n - rho, so its tangent bounds
it from above, and every d_n = ||q_n - p_k|| is convex in q_n. Their composition is a convex function that
touches sum gamma pos(softmin - r) at the current motion and lies above it everywhere else: minimising it
is a majorise-minimise step (Hunter & Lange, 2004). The QP approximates the distances to second order.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.coverage.nearest import nearest_samples
from mpc_cover.model.tolerances import NO_DIRECTION

if TYPE_CHECKING:
    from mpc_cover.arrays import BoolArray, FloatArray, IntArray
    from mpc_cover.coverage.nearest_points import Nearest
    from mpc_cover.model.look_instants import InterSample

_CURVATURE_DISTANCE_MIN = 0.3
"""Least distance in the curvature 1/d, which has a pole at 0 [m]; a plain choice."""
SAMPLES_PER_TERM = 6
"""Samples over which the soft minimum of a cell is taken; a plain choice."""


@dataclass(frozen=True)
class Softness:
    """Sharpness of the soft minimum, and the sensing margin.

    Attributes
    ----------
    beta : sharpness of the soft minimum [1/m]; it lies up to log(M)/beta below the minimum.
    margin : sensing margin [m], taken off every radius.
    count : M, nearest samples of each cell that the soft minimum is taken over.
    """

    beta: float
    margin: float
    count: int = SAMPLES_PER_TERM


def soft_minimum(excess: FloatArray, beta: float) -> tuple[FloatArray, FloatArray]:
    """Return softmin_beta over the last axis [m], (R,), and its gradient, the weights (R, M) that sum to 1."""
    least = excess.min(axis=1)
    powers = np.exp(-beta * (excess - least[:, None]))
    total = powers.sum(axis=1)
    return least - np.log(total) / beta, powers / total[:, None]


def soft_cost(
    position: FloatArray,
    cell: FloatArray,
    radius: FloatArray,
    weight: FloatArray,
    softness: Softness,
    looks: IntArray | None = None,
    between: InterSample | None = None,
) -> float:
    """Return J_beta = sum gamma pos(softmin_beta(e) + margin) [m], which a majorise-minimise step decreases.

    `position` is (N+1, m, d) [m]; further arguments as in `nearest.nearest_samples`.
    """
    nearest = nearest_samples(position, cell, radius, weight, softness.count, looks, between)
    value, _ = soft_minimum(nearest.excess, softness.beta)
    return float(nearest.weight @ np.maximum(value + softness.margin, 0.0))


@dataclass(frozen=True, eq=False)
class Majoriser:
    """The majoriser around one motion: R terms gamma pos(level + sum_n slope_n . (q_n - qbar_n) + curvature).

    Where looks count between samples, q_n stands for the point q_n + a v_n + b v_(n+1) of the interval, at the part
    of it that is nearest to the cell at the motion: the nearest of any motion is no farther.

    Attributes
    ----------
    level : (R,) softmin + margin at the motion [m].
    weight : (R,) gamma.
    sample : (R, M) flat indices n * m + i of the samples that a term depends on.
    slope : (R, M, d) w_n (qbar_n - p) / ||qbar_n - p||.
    share : (R, M) w, the gradient of the soft minimum; rows sum to 1.
    cost : sum gamma pos(level), the value at the motion [m].
    blend : (a, b) [s], (R, M) each; None where all points are samples.
    bow : (R, M) s (1 - s), by which u T_s^2 moves a point off the chord of its interval; None likewise.
    """

    level: FloatArray
    weight: FloatArray
    sample: IntArray
    slope: FloatArray
    share: FloatArray
    cost: float
    _direction: FloatArray
    _distance: FloatArray
    blend: tuple[FloatArray, FloatArray] | None = None
    bow: FloatArray | None = None

    def curvature(self, term: BoolArray, samples: int, factor: FloatArray | None = None) -> FloatArray:
        """Return (samples, d, d) [1/m]: sum over the selected terms of gamma w (I - r r') / d  (W_k of Appendix A).

        Each is multiplied by its `factor` (R, M), if that is given.
        """
        dimension = self.slope.shape[2]
        blocks = np.zeros((samples, dimension, dimension))
        scale = (self.weight[term, None] * self.share[term]) / np.maximum(self._distance[term], _CURVATURE_DISTANCE_MIN)
        scale = scale if factor is None else scale * factor[term]
        direction = self._direction[term]
        index = self.sample[term].ravel()
        for a in range(dimension):
            for b in range(a, dimension):
                entry = scale * ((a == b) - direction[:, :, a] * direction[:, :, b])
                blocks[:, a, b] = np.bincount(index, entry.ravel(), samples)
                blocks[:, b, a] = blocks[:, a, b]
        return blocks

    def across(self, term: int, nth: int) -> FloatArray:
        """Return (d, d) [m^-1/2], whose square is w (I - r r') / d of one point of a term."""
        direction = self._direction[term, nth]
        scale = self.share[term, nth] / max(float(self._distance[term, nth]), _CURVATURE_DISTANCE_MIN)
        return np.asarray(np.sqrt(scale) * (np.eye(direction.size) - np.outer(direction, direction)))

    def gradient(self, term: BoolArray, samples: int, factor: FloatArray | None = None) -> FloatArray:
        """Return (samples, d): sum over the selected terms of gamma * slope, times their `factor` (R, M) if given."""
        weighted = self.weight[term, None, None] * self.slope[term]
        weighted = weighted if factor is None else weighted * factor[term][:, :, None]
        index = self.sample[term].ravel()
        columns = [np.bincount(index, weighted[:, :, a].ravel(), samples) for a in range(weighted.shape[2])]
        return np.stack(columns, axis=1)


def build_majoriser(
    position: FloatArray,
    cell: FloatArray,
    radius: FloatArray,
    weight: FloatArray,
    softness: Softness,
    looks: IntArray | None = None,
    between: InterSample | None = None,
) -> Majoriser:
    """Return the majoriser of J_beta around a motion (N+1, m, d) [m]; arguments as in `soft_cost`."""
    nearest = nearest_samples(position, cell, radius, weight, softness.count, looks, between)
    value, share = soft_minimum(nearest.excess, softness.beta)
    blend = None if between is None or nearest.part is None else between.blend(nearest.part)
    points = position.reshape(-1, position.shape[2])[nearest.sample]
    if between is not None and blend is not None:
        before, after = between.flat()
        points = points + blend[0][..., None] * before[nearest.sample] + blend[1][..., None] * after[nearest.sample]
    direction = _directions(points, cell, nearest)
    level = value + softness.margin
    return Majoriser(
        level=level,
        weight=nearest.weight,
        sample=nearest.sample,
        slope=share[:, :, None] * direction,
        cost=float(nearest.weight @ np.maximum(level, 0.0)),
        share=share,
        _direction=direction,
        _distance=nearest.distance,
        blend=blend,
        bow=None if nearest.part is None else nearest.part * (1.0 - nearest.part),
    )


def _directions(points: FloatArray, cell: FloatArray, nearest: Nearest) -> FloatArray:
    """Return (R, M, d) unit vectors from cells to (R, M, d) points; zero, a valid subgradient, where they coincide."""
    difference = points - cell[nearest.cell][:, None, :]
    return np.asarray(difference / np.maximum(nearest.distance, NO_DIRECTION)[:, :, None])
