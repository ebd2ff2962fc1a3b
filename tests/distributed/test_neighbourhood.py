"""Where the silent may be: wherever they brake, and with whatever they were told last."""

from dataclasses import replace

import numpy as np
from flights import fleet_of
from hypothesis import given
from hypothesis import strategies as st

from mpc_cover.distributed.neighbourhood import Neighbourhood
from mpc_cover.distributed.state_report import StateReport

PERIOD = 0.5
FLEET = fleet_of(np.zeros((3, 2)))
number = st.floats(-1.0, 1.0)


def around(double=True):
    return Neighbourhood(FLEET, PERIOD, double=double, lost_after=6, margin_m=0.1)


def report(agent, sample, velocity=(0.0, 0.0), promised=False):
    return StateReport(agent, sample, PERIOD * sample, np.array([1.0, 2.0]), np.array(velocity), promised=promised)


@given(velocity=st.tuples(number, number))
def test_who_is_lost_came_to_rest_within_the_doubt(velocity):
    """Braking at once with all input, and as the stopping filter does, flown step by step."""
    last = report(1, 0, velocity)
    (state,), heard, doubt = around().states(report(0, 7), {1: last}, {})
    assert not heard[0]
    assert not state.velocity.any()
    speed = np.linalg.norm(velocity)
    hard = last.position + last.velocity * speed / (2.0 * FLEET.input_max[1])
    position, moving = last.position, last.velocity
    for _ in range(6):
        force = around().brake(replace(last, position=position, velocity=moving))
        position, moving = position + PERIOD * moving + 0.5 * PERIOD**2 * force, moving + PERIOD * force
    for rest in (hard, position):
        assert np.linalg.norm(rest - state.position) <= doubt[0] - 0.1 + 1e-6


def test_a_promise_after_the_last_state_is_another_place_to_be_in():
    newest, promised = {1: report(1, 4), 2: report(2, 5)}, {1: report(1, 5, promised=True), 2: report(2, 4)}
    states, heard, doubt = around().states(report(0, 5), newest, promised)
    assert [(state.agent, state.sample) for state in states] == [(1, 4), (1, 5), (2, 5)]
    assert heard.tolist() == [False, False, True]
    assert doubt.tolist() == [0.1, 0.1, 0.0]


def test_single_integrators_stand_where_they_are():
    last = report(1, 0, (1.0, 1.0))
    (state,), _, _ = around(double=False).states(report(0, 9), {1: last}, {})
    assert state is last
    assert around(double=False).balls([last])[1].tolist() == [0.0]
    assert not around(double=False).brake(last).any()
