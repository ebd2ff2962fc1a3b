"""Disturbed bodies stay in their tubes, within their limits, and are recorded as they truly moved."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from service_fakes import small_mission

from mpc_cover.model.motion import roll_out
from mpc_cover.model.trajectory import Trajectory
from mpc_cover.model.tube import tracking_of, tube_of
from mpc_cover.service.agent.schedule import Plant, Schedule, ScheduledPlan
from mpc_cover.service.agent.vehicle import TrackingVehicle, UndisturbedVehicle, make_vehicle
from mpc_cover.service.protocol.messages import PlanRef

WINDY = {"position_noise_m": 0.02, "input_noise_m_per_s2": 0.05, "wind_m_per_s2": [0.06, -0.08]}


def flight(start_s, position, forces, seq=0, velocity=(0.0, 0.0)):
    force = np.array(forces, dtype=float)
    q, v = roll_out(np.array([position], dtype=float), np.array([velocity], dtype=float), force[:, None], 0.5)
    return ScheduledPlan(PlanRef(1, seq), Trajectory.even(start_s, 0.5, q[:, 0], v[:, 0], force))


def there_and_back(start_s=1.0, push=0.4):
    """A plan that leaves room for all that the tube may ask for."""
    return flight(start_s, (0.75, 0.5), [[0, push], [0.1, push], [-0.1, -push], [0, -2 * push], [0, 0], [0, push]])


class Flown:
    """A body flown to the end, looked at many times."""

    def __init__(self, disturbance, plan, seed=0, until_s=6.0):
        self.mission = small_mission(disturbance=disturbance)
        self.pieces = []
        self.vehicle = make_vehicle(self.mission, 0, 0.0, seed, lambda *piece: self.pieces.append(piece))
        self.schedule = Schedule(1.0, queue=(plan,))
        self.errors, self.measured = [], []
        for time_s in np.arange(0.0, until_s, 0.0333):
            self.vehicle.advance(float(time_s), self.schedule)
            reference = self.vehicle.reference or self.vehicle.truth
            self.errors.append(np.subtract(self.vehicle.truth, reference))
            self.measured.append(self.vehicle.measured[0] - self.vehicle.truth[0])
        self.errors = np.array(self.errors)


def test_without_disturbances_it_is_where_its_plans_are():
    flown = Flown({"delay_s": 0.2}, there_and_back())
    assert isinstance(flown.vehicle, UndisturbedVehicle)
    assert not flown.errors.any()
    np.testing.assert_allclose(flown.vehicle.truth[0], there_and_back().motion.position[-1], atol=1e-12)


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 10**6))
def test_it_stays_in_its_tube_and_within_its_input(seed):
    flown = Flown(WINDY, there_and_back(), seed)
    tube = tube_of(flown.mission)
    away, faster = np.linalg.norm(flown.errors, axis=2).T
    assert 0.0 < away.max() <= tube.position_m
    assert 0.0 < faster.max() <= tube.velocity_m_per_s
    assert max(np.linalg.norm(piece[3]) for piece in flown.pieces) <= 1.0
    assert np.linalg.norm(flown.measured, axis=1).max() <= 0.02
    assert flown.vehicle.on_track


def test_the_record_is_its_true_motion():
    flown = Flown(WINDY, there_and_back())
    for (time, q, v, u, _), (later, q_next, v_next, _, _) in zip(flown.pieces, flown.pieces[1:], strict=False):
        dt = later - time
        np.testing.assert_allclose(q + dt * v + 0.5 * dt**2 * u, q_next, atol=1e-12)
        np.testing.assert_allclose(v + dt * u, v_next, atol=1e-12)


def test_before_its_first_plan_it_is_parked_and_after_its_last_it_hovers():
    flown = Flown(WINDY, there_and_back(start_s=3.0), until_s=9.0)
    parked = [piece for piece in flown.pieces if piece[0] < 3.0 - 1e-9]
    hovering = [piece for piece in flown.pieces if piece[0] > 6.5]
    assert not any(piece[3].any() or piece[2].any() for piece in parked)
    assert any(piece[2].any() for piece in hovering)
    assert flown.vehicle.on_track


def test_the_same_seed_gives_the_same_motion_however_often_it_is_looked_at():
    one, other = Flown(WINDY, there_and_back(), seed=5), Flown(WINDY, there_and_back(), seed=5)
    np.testing.assert_array_equal(one.vehicle.truth, other.vehicle.truth)
    rarely, often = make_vehicle(one.mission, 0, 0.0, 5, None), Flown(WINDY, there_and_back(), seed=5, until_s=5.9)
    rarely.advance(5.9, Schedule(1.0, queue=(there_and_back(),)))
    often.vehicle.advance(5.9, often.schedule)
    np.testing.assert_allclose(rarely.truth, often.vehicle.truth, atol=1e-9)


def test_each_agent_has_its_own_weather():
    mission = small_mission(disturbance=WINDY)
    noises = [make_vehicle(mission, index, 0.0, 0, None).measured[0] - mission.fleet.start[index] for index in (0, 1)]
    assert not np.array_equal(*noises)


def test_a_slow_agent_leaves_its_tube_and_knows():
    flown = Flown({"slow_agents": {"a1": 0.4}}, there_and_back(push=0.8), until_s=2.4)
    assert np.linalg.norm(flown.vehicle.truth[1]) == pytest.approx(0.4)
    assert not flown.vehicle.on_track
    assert np.linalg.norm(flown.errors[-1, 0]) > 0.1


def test_a_plan_that_starts_where_a_straying_agent_is_moves_the_reference_there():
    flown = Flown({"slow_agents": {"a1": 0.4}}, there_and_back(push=0.8), until_s=1.9)
    vehicle, schedule = flown.vehicle, flown.schedule
    here, now = vehicle.truth
    start = here + 0.1 * now
    schedule.add(flight(2.0 - 1e-12, start, [[0, 0], [0, -0.4], [0, -0.4]], seq=1, velocity=now))
    assert vehicle.can_reach(start, now, 2.0)
    vehicle.advance(3.0, schedule)
    assert vehicle.on_track
    vehicle.advance(6.0, schedule)
    np.testing.assert_allclose(vehicle.truth[0], schedule.flown.motion.position[-1], atol=2e-3)


@pytest.mark.parametrize(("away", "faster"), [(0.7, 0.0), (0.0, 0.8)])
def test_what_it_cannot_reach(away, faster):
    vehicle = Flown(WINDY, there_and_back(), until_s=0.5).vehicle
    (here, now), time_s = vehicle.truth, vehicle.nominal.time_s
    assert vehicle.can_reach(here + 0.3, now + 0.1, time_s + 0.5)
    assert not vehicle.can_reach(np.add(here, (away, 0.0)), np.add(now, (faster, 0.0)), time_s + 0.5)
    exact = UndisturbedVehicle(Plant(0.0, here, now))
    assert not exact.can_reach(here, now, 0.0)


def test_a_plan_at_the_limit_is_flown_within_the_limit():
    """The agent's filter allows full input; the tracker then keeps to the limit, not to the tube."""
    flown = Flown(WINDY, flight(1.0, (0.75, 0.5), [[0, 1.0], [0, 0.0], [0, -1.0]]))
    assert max(np.linalg.norm(piece[3]) for piece in flown.pieces) <= 1.0 + 1e-12
    assert isinstance(flown.vehicle, TrackingVehicle)
    assert tracking_of(flown.mission).tube.input_m_per_s2 > 0.1
