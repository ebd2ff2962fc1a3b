"""The tube: bounds on the tracking error of a disturbed agent, and on the input that its feedback takes.

An agent follows its plan's motion z_ref with the ancillary feedback u = u_ref + K (z_ref - z_measured), sampled
every state period h (Mayne, Seron and Rakovic 2005). The error e = z - z_ref then obeys, for any u_ref,

    e+ = (A - B K) e + B (g + w - k_p n),      A = [1 h; 0 1],  B = [h^2/2; h],

axis by axis, with the gust g, the constant wind w and the noise n of the measured position. From e = 0 the state
after any number of periods is a sum of powers of A - B K times past disturbances, and the sum of their norms bounds
it: the minimal robust positively invariant set, in norms (Rakovic, Kerrigan, Kouramas and Mayne 2005). As balls
are isotropic and all axes are alike, these bounds are tight.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations_with_replacement
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray
    from mpc_cover.mission.fleet import Fleet
    from mpc_cover.mission.load import Mission

_POLES = tuple(np.round(np.linspace(0.1, 0.9, 9), 1).tolist())
"""Closed-loop poles that are tried: real and positive, so that the error does not oscillate; plain choice of a grid."""
_NEGLIGIBLE = 1e-12
"""Powers of A - B K below this are left out of the sums; `_ROUNDING` makes up for them. Plain choice."""
_ROUNDING = 1.0 + 1e-9
"""Factor on the sums that bounds what truncation and rounding leave out; a plain choice."""
_POSITION_WEIGHT = 2.0
"""Weight of the position bound in the choice of gains: it reduces both the swath and the free distance of agents."""
_START_TOLERANCE = 1e-3
"""Tolerance of the start of a plan in sensing radii, and those a second; a plain choice, far above rounding."""
_NOMINAL_NOISE, _NOMINAL_PUSH = 0.01, 0.05
"""Noise in sensing radii and gusts in u_max for which gains are chosen where a mission states none: agents that are
merely slow track with feedback as well. Plain choices of a weak disturbance."""


@dataclass(frozen=True)
class DisturbanceBounds:
    """Bounds on disturbances: noise [m], gusts and wind [m/s^2], each in a ball; and the state period h [s]."""

    position_noise_m: float
    input_noise_m_per_s2: float
    wind_m_per_s2: float
    state_period_s: float

    @property
    def push_m_per_s2(self) -> float:
        """The largest disturbing acceleration [m/s^2]."""
        return self.input_noise_m_per_s2 + self.wind_m_per_s2


@dataclass(frozen=True)
class Gains:
    """K = (k_p, k_v) of the ancillary feedback [1/s^2], [1/s], the same for each axis."""

    position: float
    velocity: float


@dataclass(frozen=True)
class Tube:
    """Bounds on an agent that tracks its reference; all zero without disturbances.

    Attributes
    ----------
    position_m, velocity_m_per_s : norm of the true state minus the reference, at every instant.
    input_m_per_s2 : norm of the true acceleration minus the reference's input: feedback, gusts and wind. Plans are
        tightened by it: their inputs stay this far below u_max.
    """

    position_m: float = 0.0
    velocity_m_per_s: float = 0.0
    input_m_per_s2: float = 0.0


@dataclass(frozen=True)
class Tracking:
    """A mission's disturbance bounds, the feedback gains of its agents, and the tube that follows.

    Attributes
    ----------
    start_tolerance : of the start of a plan, see `start_tolerance`.
    """

    bounds: DisturbanceBounds
    gains: Gains
    tube: Tube
    start_tolerance: float = 0.0

    def contains(self, position: FloatArray, velocity: FloatArray) -> bool:
        """Return whether a measured tracking error (d,) [m], [m/s] lies within the tube, up to `start_tolerance`."""
        slack = self.start_tolerance
        position_error, velocity_error = float(np.linalg.norm(position)), float(np.linalg.norm(velocity))
        position_max = self.tube.position_m + self.bounds.position_noise_m
        return position_error <= position_max + slack and velocity_error <= self.tube.velocity_m_per_s + slack


def start_tolerance(fleet: Fleet) -> float:
    """Return the tolerance between the start of a plan and the agent's state at that time [m], [m/s]."""
    return _START_TOLERANCE * fleet.sensing_radius_min


def tracking_of(mission: Mission) -> Tracking:
    """Return bounds, gains and tube of a mission's agents."""
    bounds, gains = bounds_of(mission), gains_of(mission)
    return Tracking(bounds, gains, tube(bounds, gains), start_tolerance(mission.fleet))


def bounds_of(mission: Mission) -> DisturbanceBounds:
    """Return the disturbance bounds that a mission states."""
    given = mission.spec.disturbance
    wind = float(np.linalg.norm(given.wind_m_per_s2)) if given.wind_m_per_s2 else 0.0
    return DisturbanceBounds(
        given.position_noise_m, given.input_noise_m_per_s2, wind, mission.spec.control.state_period_s
    )


def tube_of(mission: Mission) -> Tube:
    """Return the tube of a mission's agents with the gains of `gains_of`; agents with a reduced speed may leave it."""
    return tracking_of(mission).tube


def gains_of(mission: Mission) -> Gains:
    """Return the gains whose tube is smallest, relative to the fleet's smallest sensing radius, speed and input."""
    fleet = mission.fleet
    return _best_gains(
        bounds_of(mission), fleet.sensing_radius_min, float(fleet.speed_max.min()), float(fleet.input_max.min())
    )


@lru_cache(maxsize=64)
def tube(bounds: DisturbanceBounds, gains: Gains) -> Tube:
    """Return the tube for these bounds; the gains must make A - B K stable.

    Between two samples the position deviates from its chord by at most a_max h^2/8; the velocity is linear.
    """
    noise = gains.position * bounds.position_noise_m
    random = noise + bounds.input_noise_m_per_s2
    response = _response(gains, bounds.state_period_s)
    sum_of_norms = np.abs(response).sum(axis=0)
    step_response = np.abs(np.cumsum(response, axis=0)).max(axis=0)
    position, velocity, feedback = (random * sum_of_norms + bounds.wind_m_per_s2 * step_response) * _ROUNDING
    force = feedback + noise + bounds.push_m_per_s2
    chord = force * bounds.state_period_s**2 / 8.0
    return Tube(float(position + chord), float(velocity), float(force))


def closed_loop(gains: Gains, period: float) -> tuple[FloatArray, FloatArray]:
    """Return A - B K (2, 2) and B (2,) of one axis, sampled every `period` [s]."""
    input_matrix = np.array([0.5 * period**2, period])
    transition = np.array([[1.0, period], [0.0, 1.0]])
    return transition - np.outer(input_matrix, [gains.position, gains.velocity]), input_matrix


def place_poles(first: float, second: float, period: float) -> Gains:
    """Return the gains [1/s^2], [1/s] that give A - B K these real poles, for a state period [s]."""
    stiffness = (1.0 - first) * (1.0 - second)
    return Gains(stiffness / period**2, (1.0 + 0.5 * stiffness - first * second) / period)


def _response(gains: Gains, period: float) -> FloatArray:
    """Return (n, 3): response of position, velocity and feedback to an impulse of acceleration, j + 1 samples later."""
    matrix, state = closed_loop(gains, period)
    rows, feedback = [state], np.array([gains.position, gains.velocity])
    power = matrix
    while np.abs(power).max() > _NEGLIGIBLE:
        rows.append(power @ rows[0])
        power = power @ matrix
    states = np.array(rows)
    return np.column_stack([states, states @ feedback])


@lru_cache(maxsize=64)
def _best_gains(bounds: DisturbanceBounds, radius: float, speed: float, force: float) -> Gains:
    if not bounds.position_noise_m and not bounds.push_m_per_s2:
        # agents that are merely slow track their plans as well
        bounds = DisturbanceBounds(_NOMINAL_NOISE * radius, _NOMINAL_PUSH * force, 0.0, bounds.state_period_s)

    def cost(gains: Gains) -> float:
        size = tube(bounds, gains)
        return _POSITION_WEIGHT * size.position_m / radius + size.velocity_m_per_s / speed + size.input_m_per_s2 / force

    pairs = combinations_with_replacement(_POLES, 2)
    return min((place_poles(*pair, bounds.state_period_s) for pair in pairs), key=cost)
