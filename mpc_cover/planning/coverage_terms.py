"""The majoriser's terms in a subproblem: rows with slacks near the edge of coverage, gradient and curvature elsewhere.

Where looks count between samples, points of the path depend on the velocities, too (`model.look_instants`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy

from mpc_cover.constraints.rows import Rows

if TYPE_CHECKING:
    from mpc_cover.arrays import BoolArray, FloatArray
    from mpc_cover.constraints.rows import Layout
    from mpc_cover.coverage.majoriser import Majoriser

_NEGLIGIBLE = 1e-6
"""Share in a soft minimum below which a sample is left out of its row: it would only fill the factors. Plain choice."""
_SLACK_CURVATURE = 1e-8
"""Quadratic cost of slacks, which makes the QP strictly convex in them; a plain choice, negligible in the optimum."""


@dataclass(frozen=True, eq=False)
class Terms:
    """The majoriser in the form of the QP, around the iterate.

    Attributes
    ----------
    linear : ((N+1) m, d) gradient of the terms that stay positive within the trust region.
    curvature : ((N+1) m, d, d) positive semi-definite blocks.
    velocity_linear, velocity_curvature : the like of velocities, see `_velocity_terms`; left out where all looks are at
        samples.
    rows : slope . (q - qbar) - s <= -level, a row and a slack for each term near the edge of coverage.
    slack_cost : gamma of those terms.
    slack_value : their pos(level) at the iterate [m].
    """

    linear: FloatArray
    curvature: FloatArray
    rows: Rows
    slack_cost: FloatArray
    slack_value: FloatArray
    velocity_linear: FloatArray | None = None
    velocity_curvature: tuple[FloatArray, ...] = ()


def coverage_terms(
    layout: Layout,
    position: FloatArray,
    majoriser: Majoriser,
    radius: float,
    *,
    velocity: FloatArray | None = None,
    swing: FloatArray | None = None,
) -> Terms:
    """Return the terms: those positive within the trust region are linear, those near 0 get slacks, others vanish.

    Where looks count between samples, points depend on `velocity` (N+1, m, d) [m/s], and `swing` is u_max T^2 (m,).
    """
    samples = position.shape[0] * layout.agents
    reach = radius * np.abs(majoriser.slope).sum(axis=(1, 2))  # a term changes by at most this
    if swing is not None and majoriser.bow is not None:
        size = np.linalg.norm(majoriser.slope, axis=2)
        reach = reach + (size * majoriser.bow * swing[majoriser.sample % layout.agents]).sum(axis=1)
    far = majoriser.level > reach
    near = np.flatnonzero(np.abs(majoriser.level) <= reach)
    linear = majoriser.gradient(far, samples)
    curvature = majoriser.curvature(majoriser.level > 0.0, samples)
    sample, slope = majoriser.sample[near], majoriser.slope[near]
    term, nth = np.nonzero(majoriser.share[near] >= _NEGLIGIBLE)
    sample, slope = sample[term, nth], slope[term, nth]
    column = (sample * layout.dimension)[:, None] + np.arange(layout.dimension)
    each = np.einsum("ed,ed->e", slope, position.reshape(samples, layout.dimension)[sample])
    entries = [(term, column, slope)]
    velocity_linear: FloatArray | None = None
    velocity_curvature: tuple[FloatArray, ...] = ()
    if majoriser.blend is not None and velocity is not None:
        before, after = (factor[near][term, nth] for factor in majoriser.blend)
        following = np.minimum(sample + layout.agents, sample + (samples - 1 - sample) // layout.agents * layout.agents)
        for factor, owner in ((before, sample), (after, following)):
            some = factor > 0.0
            there = layout.half + (owner[some] * layout.dimension)[:, None] + np.arange(layout.dimension)
            part = factor[some, None] * slope[some]
            each += np.bincount(
                np.flatnonzero(some), np.einsum("ed,ed->e", part, velocity.reshape(samples, -1)[owner[some]]), each.size
            )
            entries.append((term[some], there, part))
        velocity_linear, velocity_curvature = _velocity_terms(majoriser, far, samples, layout.agents)
    here = np.bincount(term, each, near.size)
    rows = Rows(
        row=np.concatenate([np.repeat(row, layout.dimension) for row, _, _ in entries]),
        column=np.concatenate([columns.ravel() for _, columns, _ in entries]),
        value=np.concatenate([values.ravel() for _, _, values in entries]),
        lower=np.full(near.size, -np.inf),
        upper=here - majoriser.level[near],
        elastic=np.arange(near.size),
    )
    cost, value = majoriser.weight[near], np.maximum(majoriser.level[near], 0.0)
    return Terms(linear, curvature, rows, cost, value, velocity_linear, velocity_curvature)


def _velocity_terms(
    majoriser: Majoriser, far: BoolArray, samples: int, agents: int
) -> tuple[FloatArray, tuple[FloatArray, ...]]:
    """Return the gradient ((N+1) m, d) of far terms by velocities, and five kinds of blocks of curvature.

    Blocks ((N+1) m, d, d) belong to the sample before: q v, q v+, v v, v v+, v+ v+, with v+ at the sample after.
    """
    assert majoriser.blend is not None
    before, after = majoriser.blend
    positive = majoriser.level > 0.0
    linear = majoriser.gradient(far, samples, before)
    linear[agents:] += majoriser.gradient(far, samples, after)[:-agents]
    factors = (before, after, before**2, before * after, after**2)
    return linear, tuple(majoriser.curvature(positive, samples, factor) for factor in factors)


def coverage_qp_cost(
    layout: Layout, terms: Terms, iterate: FloatArray, slack_cost: FloatArray, proximal: float
) -> tuple[scipy.sparse.csc_array[np.float64], FloatArray]:
    """Return P (upper triangle) and q of the QP: coverage terms, proximal term around the iterate, slacks."""
    size, dimension = layout.size, layout.dimension
    blocks = terms.curvature + proximal * np.eye(dimension)
    centred = np.einsum("nab,nb->na", blocks, iterate[: layout.half].reshape(-1, dimension))
    linear = np.concatenate([(terms.linear - centred).ravel(), -proximal * iterate[layout.half :], slack_cost])
    cross: scipy.sparse.csc_array[np.float64] | None = None
    if terms.velocity_linear is not None:
        cross = _velocity_curvature(layout, terms.velocity_curvature, size + slack_cost.size)
        linear[layout.half : size] += terms.velocity_linear.ravel()
        here = np.concatenate([iterate, np.zeros(slack_cost.size)])
        linear -= cross @ here + cross.T @ here - cross.diagonal() * here
    first = dimension * np.arange(blocks.shape[0])
    above, right = np.triu_indices(dimension)
    row = np.concatenate([(first[:, None] + above).ravel(), np.arange(layout.half, size + slack_cost.size)])
    column = np.concatenate([(first[:, None] + right).ravel(), np.arange(layout.half, size + slack_cost.size)])
    value = np.concatenate(
        [blocks[:, above, right].ravel(), np.full(layout.half, proximal), np.full(slack_cost.size, _SLACK_CURVATURE)]
    )
    total = size + slack_cost.size
    quadratic = scipy.sparse.csc_array((value, (row, column)), shape=(total, total))
    if cross is not None:
        quadratic = scipy.sparse.csc_array(quadratic + cross)
    quadratic.sum_duplicates()
    return quadratic, linear


def _velocity_curvature(
    layout: Layout, blocks: tuple[FloatArray, ...], columns: int
) -> scipy.sparse.csc_array[np.float64]:
    """Return the curvature of points between samples that involves velocities (upper triangle), (columns, columns)."""
    dimension = layout.dimension
    sample = np.arange((layout.steps + 1) * layout.agents)
    q = dimension * sample
    v, later = layout.half + q, layout.half + q + dimension * layout.agents
    rows, places, values = [], [], []
    for block, (row, column) in zip(blocks, ((q, v), (q, later), (v, v), (v, later), (later, later)), strict=True):
        live = np.flatnonzero(block.any(axis=(1, 2)))
        first, second = np.indices((dimension, dimension))
        keep = first <= second if row is column else np.ones_like(first, dtype=bool)
        rows.append((row[live, None] + first[keep]).ravel())
        places.append((column[live, None] + second[keep]).ravel())
        values.append(block[live][:, keep].ravel())
    data = (np.concatenate(values), (np.concatenate(rows), np.concatenate(places)))
    return scipy.sparse.csc_array(data, shape=(columns, columns))
