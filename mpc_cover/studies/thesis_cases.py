"""The simulations of chapters 5 and 6 as scenarios.

The thesis gives rho = 1, u_max = 1, eight nodes, K = 15, rho_B = 0.5, R_B = 1, rho_C = 5.5, R_C = 4 and delta = 8. It
does not give the size of W, the cells, T_s, alpha and beta, or any parameter of the field: here W is a square of
10 m, cells are 0.5 m, T_s is 0.5 s, alpha = 4 and beta = 0.5^4 m^4; P(0) = 1, R = 1 and P_max = 1/16, so that a
cell takes 15 looks as with K-coverage.
"""

from __future__ import annotations

from dataclasses import replace

from mpc_cover.mission.config import Dynamics
from mpc_cover.studies.swarm_parameters import (
    Information,
    KalmanInformation,
    LookInformation,
    Scenario,
    SwarmParameters,
)

LOOKS = LookInformation(15)
KALMAN = KalmanInformation(variance=1.0, noise=1.0, enough=0.0625)
DELAY = 8
"""delta [samples]."""


def free(information: Information, maps_every: int = 0) -> Scenario:
    """Return the scenario of figures 5.1 and 5.2 (looks) or 5.3 and 5.4 (Kalman): no constraints, global knowledge."""
    return Scenario(SwarmParameters(information=information, maps_every=maps_every))


def constrained(information: Information, delay: int = DELAY, maps_every: int = 0) -> Scenario:
    """Return the scenario of figures 6.2 and 6.3 (looks) or 6.4 and 6.5 (Kalman); a delay of 0 for comparison."""
    swarm = SwarmParameters(information=information, delay=delay, maps_every=maps_every)
    return Scenario(swarm, separation_m=0.5, range_m=5.5)


def as_double_integrators(scenario: Scenario, input_max_m_per_s2: float = 1.5) -> Scenario:
    """Return the same scenario flown by double integrators, whose speed bound is the single integrators' u_max."""
    swarm = replace(scenario.swarm, dynamics=Dynamics.DOUBLE)
    return replace(scenario, swarm=swarm, input_max_m_per_s2=input_max_m_per_s2)


CASES = {
    "5.1": free(LOOKS),
    "5.3": free(KALMAN),
    "6.2": constrained(LOOKS),
    "6.4": constrained(KALMAN),
    "6.2, global knowledge": constrained(LOOKS, 0),
    "6.4, global knowledge": constrained(KALMAN, 0),
    "6.2, double integrators": as_double_integrators(constrained(LOOKS)),
    "6.4, double integrators": as_double_integrators(constrained(KALMAN)),
}
"""Scenarios by the figure that shows them first."""
