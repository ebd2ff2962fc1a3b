"""Double integrators: the stopping balls' argument, step by step, and what the verifier says of the whole path."""

from __future__ import annotations

import numpy as np
import pytest
from crowds import SEPARATION, WISHES, crowd
from flights import fleet_of
from hypothesis import given, settings
from hypothesis import strategies as st

from mpc_cover.distributed.double_integrator_filter import limited, stopping_balls, track
from mpc_cover.distributed.potential_functions import Coordination
from mpc_cover.distributed.potential_law import Bounds, LawParameters, PotentialLaw
from mpc_cover.information.delay import adjacency
from mpc_cover.verification.motion import verify_motion

PERIOD, FORCE, SPEED, RANGE = 0.5, 1.5, 1.2, 4.0
BOX = 12.0


def law(agents, dimension=2, edges="both"):
    bounds = Bounds(np.full(agents, SPEED), np.full(agents, FORCE), np.full(dimension, -BOX), np.full(dimension, BOX))
    coordination = Coordination(SEPARATION, 1.0, RANGE, 3.0)
    return PotentialLaw(np.zeros((1, dimension)), bounds, coordination, LawParameters(edges=edges), PERIOD)


def moved(position, velocity, force):
    return position + PERIOD * velocity + 0.5 * PERIOD**2 * force, velocity + PERIOD * force


def fly(rng, position, wish, steps, *, edges="both", deaf=0.0):
    """Return a flight (position, velocity, force); agents that are deaf for a step brake."""
    agents = len(position)
    filtered = law(agents, position.shape[1], edges)
    states, forces = [(position, np.zeros_like(position))], []
    for n in range(steps):
        q, v = states[-1]
        force = filtered.force(q, v, wish(rng, q, n), filtered.kept_edges(q, v))
        brake = stopping_balls(q, v, np.full(agents, FORCE), PERIOD).force
        forces.append(np.where(rng.random((agents, 1)) < deaf, brake, force))
        states.append(moved(q, v, forces[-1]))
    q, v = (np.array(each) for each in zip(*states, strict=True))
    return q, v, np.array(forces)


def report_of(flight):
    position, velocity, force = flight
    dimension = position.shape[2]
    fleet = fleet_of(
        position[0],
        input_max=np.full(position.shape[1], FORCE),
        speed_max=np.full(position.shape[1], SPEED),
        separation_min=SEPARATION,
        communication_range=RANGE,
        motion_min=np.full(dimension, -BOX),
        motion_max=np.full(dimension, BOX),
    )
    time = PERIOD * np.arange(len(position))
    return verify_motion(fleet, time, position, velocity, force, start=(position[0], velocity[0]))


@pytest.mark.parametrize("kind", WISHES)
@pytest.mark.parametrize(("agents", "dimension", "edges"), [(8, 2, "both"), (12, 2, "own"), (6, 3, "either")])
def test_every_limit_holds_at_every_instant(kind, agents, dimension, edges):
    rng = np.random.default_rng(agents)
    flight = fly(rng, crowd(rng, agents, dimension), WISHES[kind], 150, edges=edges)
    assert (report := report_of(flight)).holds, str(report.first_failure)
    stays = kind in ("crush", "swap")  # who touch and press against each other
    assert stays or np.linalg.norm(flight[1], axis=2).max() > 0.3, "the fleet does move"


def test_hundreds_of_steps_of_a_crowd_in_which_some_do_not_hear():
    rng = np.random.default_rng(1)
    flight = fly(rng, crowd(rng, 16), WISHES["turn"], 300, deaf=0.2)
    assert (report := report_of(flight)).holds, str(report.first_failure)


@settings(max_examples=200)
@given(seed=st.integers(0, 10**6), dimension=st.sampled_from([2, 3]))
def test_braking_takes_the_rest_of_the_segment_and_its_ball_lies_in_the_ball_before(seed, dimension):
    rng = np.random.default_rng(seed)
    q, v = rng.normal(size=(1, dimension)), rng.normal(size=(1, dimension)) * rng.uniform(0.0, 4.0)
    most = np.array([FORCE])
    first = stopping_balls(q, v, most, PERIOD)
    ball, samples = first, 0
    while np.linalg.norm(v) > 1e-9:
        assert np.linalg.norm(ball.force) <= FORCE
        q, v = moved(q, v, ball.force)
        after = stopping_balls(q, v, most, PERIOD)
        assert np.linalg.norm(after.centre - ball.centre) + after.radius[0] <= ball.radius[0] + 1e-9
        np.testing.assert_allclose(after.stop, first.stop, atol=1e-9)
        ball, samples = after, samples + 1
    assert samples <= 40
    np.testing.assert_allclose(q, first.stop, atol=1e-9)


@settings(max_examples=200)
@given(seed=st.integers(0, 10**6))
def test_the_path_of_a_step_lies_between_its_bezier_points(seed):
    """q + v T / 2 is on the braking segment, so in the ball of now."""
    rng = np.random.default_rng(seed)
    q, v = rng.normal(size=(1, 2)), rng.normal(size=(1, 2)) * rng.uniform(0.0, 4.0)
    ball = stopping_balls(q, v, np.array([FORCE]), PERIOD)
    assert np.linalg.norm(q + 0.5 * PERIOD * v - ball.centre) <= ball.radius[0] + 1e-12


@settings(max_examples=30)
@given(seed=st.integers(0, 10**6))
def test_an_agent_needs_those_only_that_it_hears(seed):
    rng = np.random.default_rng(seed)
    q, v, _ = fly(rng, crowd(rng, 9), WISHES["storm"], 6, edges="own")
    position, velocity, wish = q[-1], v[-1], rng.normal(size=(9, 2))
    whole = law(9, edges="own")
    force = whole.force(position, velocity, wish, whole.kept_edges(position, velocity))
    heard = adjacency(position, RANGE) | np.eye(9, dtype=bool)
    for agent in range(9):
        near = np.flatnonzero(heard[agent])
        me = int(np.flatnonzero(near == agent)[0])
        part = law(len(near), edges="own")
        kept = part.kept_edges(position[near], velocity[near])
        alone = part.force(position[near], velocity[near], wish[near], kept)
        np.testing.assert_allclose(alone[me], force[agent], atol=1e-12)


def test_a_range_too_short_for_the_braking_distance_is_refused():
    bounds = Bounds(np.full(2, 3.0), np.full(2, 0.5), np.full(2, -9.0), np.full(2, 9.0))
    with pytest.raises(ValueError, match="communication range"):
        PotentialLaw(np.zeros((1, 2)), bounds, Coordination(0.5, 1.0, 5.5, 4.0), LawParameters(), PERIOD)


@given(seed=st.integers(0, 10**6))
def test_tracking_stays_within_the_limits_and_arrives(seed):
    rng = np.random.default_rng(seed)
    most, fastest, period = np.array([1.5, 0.7]), np.array([1.0, 2.0]), 0.5
    velocity = limited(rng.normal(size=(2, 2)) * 3.0, fastest)
    wish = rng.normal(size=(2, 2)) * 3.0
    for _ in range(20):
        force = track(velocity, wish, most, fastest, period)
        assert (np.linalg.norm(force, axis=1) <= most * (1.0 + 1e-12)).all()
        velocity = velocity + period * force
        assert (np.linalg.norm(velocity, axis=1) <= fastest * (1.0 + 1e-12)).all()
    np.testing.assert_allclose(velocity, limited(wish, fastest), atol=1e-9)
