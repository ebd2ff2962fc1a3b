"""The interface of a run of the distributed law that the figures of chapters 5 and 6 draw."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from mpc_cover.arrays import BoolArray, FloatArray
    from mpc_cover.mission.field import Field
    from mpc_cover.mission.fleet import Fleet
    from mpc_cover.verification.path import Path


class Maps(Protocol):
    """Maps at S moments."""

    @property
    def time(self) -> FloatArray:
        """(S,) [s]."""
        ...

    @property
    def true(self) -> FloatArray:
        """(S, K) gamma of all looks."""
        ...

    @property
    def own(self) -> FloatArray:
        """(S, m, K) gamma as each agent knows it."""
        ...

    @property
    def estimate(self) -> FloatArray:
        """(S, m, K) each agent's estimate of the field; (S, m, 0) without one."""
        ...


class SwarmRun(Protocol):
    """A run of T samples; `studies.swarm_record` has one."""

    @property
    def fleet(self) -> Fleet:
        """The agents."""
        ...

    @property
    def field(self) -> Field:
        """The cells."""
        ...

    @property
    def path(self) -> Path:
        """The continuous path."""
        ...

    @property
    def residual(self) -> FloatArray:
        """(T,) residual information, 1 at the start."""
        ...

    @property
    def own_residual(self) -> FloatArray:
        """(T, m) residual information by each agent's knowledge."""
        ...

    @property
    def kept(self) -> BoolArray:
        """(T, m, m) edges kept in the interval that follows."""
        ...

    @property
    def truth(self) -> FloatArray:
        """(K,) the field; empty without one."""
        ...

    @property
    def maps(self) -> Maps:
        """Maps at some samples."""
        ...
