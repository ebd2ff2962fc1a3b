"""Polytopes inscribed in discs and balls: inner approximations that are exact in the direction of the iterate."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations, product
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.model.tolerances import DIVISOR_MIN, NO_DIRECTION

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray

_PARALLEL = 1e-9
"""Determinant of three unit normals below which their facets meet in no vertex; a plain choice."""
_ON_FACET = 1.0 + 1e-9
"""Bound on |a_f . x| of a vertex of {|a_f . x| <= 1} that allows for rounding; a plain choice."""


@dataclass(frozen=True, eq=False)
class Facets:
    """A centrally symmetric polytope {x : |a_f . x| <= shrink * radius} inside the ball of that radius.

    Attributes
    ----------
    normal : (F, d) unit normals, one of each opposite pair.
    vertex : (d,) unit vector towards a vertex, where the polytope touches the ball.
    shrink : inradius over circumradius.
    """

    normal: FloatArray
    vertex: FloatArray
    shrink: float


@lru_cache(maxsize=8)
def inscribed(dimension: int, sides: int) -> Facets:
    """Return a regular polygon of `sides` sides (even), or in three dimensions a polyhedron of 26 facets."""
    if dimension == 2:  # noqa: PLR2004 - planar
        angle = np.pi * (1 + 2 * np.arange(sides // 2)) / sides
        normal = np.stack([np.cos(angle), np.sin(angle)], axis=1)
        return Facets(normal, np.array([1.0, 0.0]), float(np.cos(np.pi / sides)))
    grid = np.array([n for n in product((-1, 0, 1), repeat=3) if n > (0, 0, 0)], dtype=float)
    normal = grid / np.linalg.norm(grid, axis=1, keepdims=True)
    vertices = _vertices(normal)
    length = np.linalg.norm(vertices, axis=1)
    farthest = int(np.argmax(length))
    return Facets(normal, vertices[farthest] / length[farthest], float(1.0 / length[farthest]))


def _vertices(normal: FloatArray) -> FloatArray:
    """Return the vertices of {x : |a_f . x| <= 1} in three dimensions, by trying all triples of facets."""
    both = np.concatenate([normal, -normal])
    found = []
    for triple in combinations(range(len(both)), 3):
        matrix = both[list(triple)]
        if abs(np.linalg.det(matrix)) > _PARALLEL:
            point = np.linalg.solve(matrix, np.ones(3))
            if (both @ point <= _ON_FACET).all():
                found.append(point)
    return np.array(found)


def turned_normals(facets: Facets, direction: FloatArray) -> FloatArray:
    """Return (..., F, d) normals of the polytope reflected so that a vertex lies along `direction` (..., d).

    The inner approximation is then exact at the iterate, which stays feasible. A Householder reflection maps the
    vertex; for a zero direction the polytope is returned as it is.
    """
    length = np.linalg.norm(direction, axis=-1, keepdims=True)
    unit = np.where(length > NO_DIRECTION, direction / np.maximum(length, DIVISOR_MIN), facets.vertex)
    mirror = facets.vertex - unit
    square = np.maximum(np.sum(mirror**2, axis=-1, keepdims=True), DIVISOR_MIN**2)
    dot = mirror @ facets.normal.T
    return np.asarray(facets.normal - 2.0 * (dot / square)[..., None] * mirror[..., None, :])
