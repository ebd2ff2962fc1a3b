"""Fields, fleets and random flights for tests of information maps."""

from __future__ import annotations

import numpy as np

from mpc_cover.information.visibility import Visibility
from mpc_cover.mission.config import Area, BoxShape, DiscShape, PolygonShape
from mpc_cover.mission.field import Field, build_field


def box_field(width=6.0, height=5.0, size=0.5):
    return build_field(Area(shape=BoxShape(kind="box", min_m=(0.0, 0.0), max_m=(width, height)), cell_size_m=size))


def odd_fields():
    """Return fields whose last row is pulled in, with holes, round, far from the origin, in space."""
    shapes = [
        (BoxShape(kind="box", min_m=(-3.0, 2.0), max_m=(1.3, 6.1)), 0.7),
        (DiscShape(kind="disc", center_m=(100.0, -50.0), radius_m=3.0), 0.45),
        (
            PolygonShape(
                kind="polygon",
                outline_m=((0, 0), (6, 0), (6, 3), (3, 3), (3, 6), (0, 6)),
                holes_m=(((1, 1), (2, 1), (2, 2), (1, 2)),),
            ),
            0.4,
        ),
        (BoxShape(kind="box", min_m=(0.0, 0.0, 0.0), max_m=(3.0, 2.2, 1.0)), 0.5),
        (BoxShape(kind="box", min_m=(0.0, 0.0), max_m=(0.3, 0.2)), 0.5),
    ]
    return [build_field(Area(shape=shape, cell_size_m=size)) for shape, size in shapes]


def seeing(field: Field, agents=3, radius=1.0):
    return Visibility(field, np.full((agents, 1), radius))


def flight(rng, field: Field, steps=12, agents=3, step=0.6):
    """Return (steps, m, d) positions of random walks that start in the field's box and may leave it."""
    start = rng.uniform(field.shape_min, field.shape_max, (agents, field.cell.shape[1]))
    moves = rng.normal(0.0, step, (steps, *start.shape))
    moves[0] = 0.0
    return start + np.cumsum(moves, axis=0)
