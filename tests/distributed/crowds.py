"""Dense fleets and wishes that mean harm, for tests of the filters."""

from __future__ import annotations

import numpy as np

from mpc_cover.constraints.local_tree import distances

SEPARATION, RANGE = 0.5, 3.6


def crowd(rng, agents, dimension=2, apart=SEPARATION, reach=RANGE):
    """Return a connected fleet, most of it as close together as it may be."""
    placed = [np.zeros(dimension)]
    while len(placed) < agents:
        tight = rng.random() < 0.7
        away = apart * (1.0 + 1e-9) if tight else rng.uniform(apart, reach)
        ahead = rng.normal(size=dimension)
        point = placed[int(rng.integers(len(placed)))] + away * ahead / np.linalg.norm(ahead)
        if min(np.linalg.norm(point - other) for other in placed) >= apart:
            placed.append(point)
    return np.array(placed)


WISHES = {
    "scatter": lambda rng, q, n: 3.0 * (q - q.mean(axis=0)) + 0.1 * rng.normal(size=q.shape),
    "crush": lambda rng, q, n: -3.0 * (q - q.mean(axis=0)),
    "swap": lambda rng, q, n: np.roll(q, 1, axis=0) - q,
    "tear": lambda rng, q, n: np.where(np.arange(len(q))[:, None] % 2 == 0, 1.0, -1.0) * np.eye(q.shape[1])[0],
    "storm": lambda rng, q, n: rng.normal(size=q.shape) * 3.0,
    "turn": lambda rng, q, n: (1.0 if n % 40 < 20 else -1.0) * 3.0 * (q - q.mean(axis=0)) + rng.normal(size=q.shape),
}


def pair_lengths(position):
    return distances(position)[np.triu_indices(len(position), 1)]
