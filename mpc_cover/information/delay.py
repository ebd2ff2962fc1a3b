"""Models of the delay with which agents know of each other (5.2.1.1, 6.3): fixed, or by hops over the network."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

import numpy as np

if TYPE_CHECKING:
    from mpc_cover.arrays import BoolArray, FloatArray, IntArray

_NEVER = -1
"""Sample number of an agent of which none is known."""


class Delay(Protocol):
    """Returns, sample by sample, the newest sample of each agent that each agent knows."""

    def known(self, sample: int, adjacent: BoolArray) -> IntArray:
        """Return (m, m): the newest sample of agent j (column) that agent i (row) knows; -1 for none.

        Called once a sample, in order; `adjacent` (m, m) is which agents hear each other at that sample.
        """
        ...


class FixedDelay:
    """Every agent knows the others' sample n - delta at sample n, and nothing while n < delta (6.3).

    For n <= delta the thesis holds the others' start and would count it in every step, which breaks the
    over-estimate that it relies on; here, as in its own stochastic case, nothing is counted then.

    Parameters
    ----------
    steps : delta [samples], one number or (m, m) by the agent that knows (row) of another (column); 0 is global
        knowledge.

    Raises
    ------
    ValueError
        A negative delay.
    """

    def __init__(self, steps: int | IntArray) -> None:
        if (np.asarray(steps) < 0).any():
            raise ValueError(f"delay {steps}: must be at least 0 samples")
        self._steps = steps

    def known(self, sample: int, adjacent: BoolArray) -> IntArray:
        """Return (m, m): the newest sample of j that i knows; -1 for none."""
        newest = np.maximum(sample - np.broadcast_to(self._steps, adjacent.shape), _NEVER)
        np.fill_diagonal(newest, sample)
        return np.asarray(newest, dtype=np.intp)


class RelayDelay:
    """Agents send their neighbours everything they know, one hop a sample: the delay is the number of hops.

    Over a constant graph, agent i knows sample n - h of an agent h hops away. When the graph changes, samples that
    were known stay known.
    """

    def __init__(self, agents: int) -> None:
        self._known: IntArray = np.full((agents, agents), _NEVER, dtype=np.intp)

    def known(self, sample: int, adjacent: BoolArray) -> IntArray:
        """Return (m, m): the newest sample of j that i knows; -1 for none."""
        received = np.where(adjacent[:, :, None], self._known[None], _NEVER).max(axis=1, initial=_NEVER)
        self._known = np.maximum(self._known, received)
        np.fill_diagonal(self._known, sample)
        return self._known.copy()


def adjacency(position: FloatArray, reach: float) -> BoolArray:
    """Return (m, m): which agents at (m, d) positions [m] are within `reach` [m]; False on the diagonal."""
    offset = position[:, None] - position[None]
    near = (offset**2).sum(axis=2) <= reach**2
    np.fill_diagonal(near, val=False)
    return np.asarray(near)


def hop_counts(adjacent: BoolArray) -> IntArray:
    """Return (m, m): the fewest hops between two agents; m where there is no path."""
    agents = adjacent.shape[0]
    hops = np.full((agents, agents), agents, dtype=np.intp)
    reached = np.eye(agents, dtype=bool)
    for step in range(agents):
        hops[reached & (hops == agents)] = step
        reached = reached | (reached @ adjacent)
    return hops
