"""Delayed maps: each agent's own knowledge of the residual information, which over-estimates it (5.2.1.1)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Generic, Protocol, TypeVar

from mpc_cover.information.looks import Looks, joined

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mpc_cover.arrays import BoolArray, FloatArray
    from mpc_cover.information.delay import Delay


class TakesLooks(Protocol):
    """A map that fuses looks in any order."""

    def take(self, looks: Looks) -> None:
        """Take in looks, each once."""
        ...

    @property
    def residual(self) -> FloatArray:
        """(J, K) gamma >= 0."""
        ...


M = TypeVar("M", bound=TakesLooks)


class HeardMap(Generic[M]):
    """One agent's own map: it takes in each sample of each agent once, however often and late it is received.

    For an agent that runs by itself. gamma depends only on which looks were taken in, so a map that lacks some
    over-estimates: when it is zero, everything is covered.

    Attributes
    ----------
    map : the map that looks are fused into.
    """

    def __init__(self, inner: M, agents: int) -> None:
        self.map = inner
        self._next = [0] * agents
        self._ahead: list[set[int]] = [set() for _ in range(agents)]

    def hear(self, agent: int, sample: int, looks: Looks) -> bool:
        """Take in what `agent` (index) measured at its `sample` (0, 1, ...); False where that was known already."""
        if not self.note(agent, sample):
            return False
        self.map.take(looks)
        return True

    def note(self, agent: int, sample: int) -> bool:
        """Note that a sample is known, whose looks the caller takes in; False where it was known already."""
        if sample < self._next[agent] or sample in self._ahead[agent]:
            return False
        self._ahead[agent].add(sample)
        while self._next[agent] in self._ahead[agent]:
            self._ahead[agent].remove(self._next[agent])
            self._next[agent] += 1
        return True

    def missing(self, agent: int) -> int:
        """Return the first sample of `agent` not received yet, to be requested from neighbours."""
        return self._next[agent]


class DelayedMaps(Generic[M]):
    """All agents' maps in one process: simulates which agent knows which looks when.

    Attributes
    ----------
    maps : (m,) each agent's own.
    """

    def __init__(self, maps: Sequence[M], delay: Delay) -> None:
        self.maps = tuple(maps)
        self._delay = delay
        self._fused = [[-1] * len(self.maps) for _ in self.maps]
        self._log: dict[int, list[Looks]] = {}

    def observe(self, sample: int, looks: Looks, adjacent: BoolArray) -> None:
        """Record the fleet's looks at a sample, and update each map with those that its agent knows by then.

        `sample` counts 0, 1, 2, ...; `adjacent` (m, m) is which agents hear each other.
        """
        self._log[sample] = [looks.where(looks.agent == j) for j in range(len(self.maps))]
        known = self._delay.known(sample, adjacent)
        for own, fused, newest in zip(self.maps, self._fused, known.tolist(), strict=True):
            fresh = [self._log[s][j] for j, latest in enumerate(newest) for s in range(fused[j] + 1, latest + 1)]
            if fresh:
                own.take(joined(fresh))
            fused[:] = [max(before, latest) for before, latest in zip(fused, newest, strict=True)]
        oldest = min(min(row) for row in self._fused)
        for done in [s for s in self._log if s <= oldest]:
            del self._log[done]
