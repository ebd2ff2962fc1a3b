"""(1.1) to (1.3) against their own recursion and each other, and the simulations against the model."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mpc_cover.errors import InvalidInputError
from mpc_cover.studies.fleet_sizing import (
    SizingProblem,
    agents_for_rate,
    covered_fraction,
    measurement_rate,
    model_error,
    sizing_table,
    swept_part,
)
from mpc_cover.studies.sizing_simulation import coverage_curve, coverage_curves, scenario_of

PROBLEM = SizingProblem(area_m2=100.0, radius_m=1.0, speed_m_per_s=1.5, cover=0.95)


def test_the_recursion_of_1_1_gives_1_2():
    """Written out as in the thesis: A_u(k+1) = (1 - dA_N / A_tot) A_u(k)."""
    total, radius, speed, agents = 100.0, 1.0, 1.5, 10
    disc = math.pi * radius**2 / total
    swept = speed / (2.0 * radius) * total * (1.0 - (1.0 - disc) ** agents)
    left = total * (1.0 - disc) ** agents
    for second in range(20):
        assert covered_fraction(PROBLEM, agents, np.array([second]))[0] == pytest.approx(1.0 - left / total)
        left *= 1.0 - swept / total
    assert swept_part(PROBLEM, agents) == pytest.approx(swept / total)


@given(agents=st.integers(1, 60), cover=st.floats(0.5, 0.999))
def test_1_3_is_one_over_the_time_of_1_2(agents, cover):
    problem = SizingProblem(100.0, 1.0, 1.5, cover)
    rate = measurement_rate(problem, agents)
    if math.isinf(rate):
        assert covered_fraction(problem, agents, np.zeros(1))[0] >= cover - 1e-12
    else:
        assert covered_fraction(problem, agents, np.array([1.0 / rate]))[0] == pytest.approx(cover)


@given(rate=st.floats(1e-4, 50.0), cover=st.floats(0.3, 0.99))
def test_the_least_number_for_a_rate(rate, cover):
    problem = SizingProblem(100.0, 1.0, 1.5, cover)
    agents = agents_for_rate(problem, rate)
    assert measurement_rate(problem, agents) >= rate
    assert agents == 1 or measurement_rate(problem, agents - 1) < rate


def test_the_rate_is_almost_proportional_to_the_number():
    rates = [row.rate_hz for row in sizing_table(PROBLEM, range(1, 16))]
    each = np.array(rates) / np.arange(1, 16)
    assert each.max() / each.min() < 1.2
    assert (np.diff(rates) > 0.0).all()


def test_the_table():
    row = sizing_table(PROBLEM, [5])[0]
    assert row.round_s == pytest.approx(24.19, abs=0.01)
    assert row.rate_hz == pytest.approx(1.0 / row.round_s)
    assert row.at_rest == pytest.approx(1.0 - (1.0 - math.pi / 100.0) ** 5)
    assert sizing_table(PROBLEM, [500])[0].round_s == 0.0


def test_the_error_is_the_mean_difference():
    time = np.array([0.0, 1.0, 2.0])
    shifted = covered_fraction(PROBLEM, 5, time) + np.array([0.0, 0.1, -0.2])
    error = model_error(PROBLEM, 5, time, shifted)
    assert error.mean_absolute == pytest.approx(0.1)
    assert error.largest == pytest.approx(0.2)


@pytest.mark.parametrize(
    ("values", "where"),
    [
        ((0.0, 1.0, 1.0), "area_m2"),
        ((100.0, math.nan, 1.0), "radius_m"),
        ((100.0, 1.0, math.inf), "speed_m_per_s"),
        ((100.0, 1.0, 1.0, 1.0), "cover"),
        ((3.0, 1.0, 1.0), "radius_m"),
        ((100.0, 1.0, 2.5), "speed_m_per_s"),
    ],
)
def test_numbers_that_make_no_sense(values, where):
    with pytest.raises(InvalidInputError, match=where):
        SizingProblem(*values)


@pytest.mark.parametrize("rate", [0.0, math.nan, math.inf])
def test_a_rate_that_makes_no_sense(rate):
    with pytest.raises(InvalidInputError, match="rate_hz"):
        agents_for_rate(PROBLEM, rate)


def test_a_rate_that_takes_a_million_agents():
    with pytest.raises(InvalidInputError, match="million"):
        agents_for_rate(SizingProblem(1e12, 1.0, 1.0), 10.0)


def test_simulations_start_where_the_model_does_and_beat_it():
    curve = coverage_curve(PROBLEM, 10, range(3))
    assert curve.simulated[0] == pytest.approx(curve.model[0], abs=0.08)
    assert curve.simulated[-1] > 0.99
    assert curve.rate_hz > measurement_rate(PROBLEM, 10), "who looks where nobody has looked is faster"
    assert 0.0 < curve.error.mean_absolute < 0.25
    assert (curve.spread[0] <= curve.simulated).all()
    assert (curve.simulated <= curve.spread[1]).all()


def test_curves_of_several_fleets_share_their_time():
    curves = coverage_curves(PROBLEM, (8, 15), range(2))
    assert [curve.agents for curve in curves] == [8, 15]
    assert np.array_equal(curves[0].time, curves[1].time)
    assert curves[0].time[-1] >= 1.0 / measurement_rate(PROBLEM, 8)


def test_the_square_has_the_area():
    fleet, field = scenario_of(SizingProblem(50.0, 0.7, 1.0), 3).build(np.random.default_rng(0))
    assert field.measure == pytest.approx(50.0)
    assert fleet.size == 3
