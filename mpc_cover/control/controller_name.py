"""The controllers that can fly a mission, by the names that options and files use."""

from __future__ import annotations

from enum import StrEnum


class ControllerName(StrEnum):
    """A controller."""

    MPC = "mpc"
    """The receding horizon: one controller for the fleet."""
    POTENTIAL = "potential"
    """The distributed potential law: each agent by itself, without a controller."""
    SWEEP = "sweep"
    """A static boustrophedon partition, for comparison in studies only."""
