"""Planted violations: each is caught by the check that is meant for it, and by no other."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from flights import box3_flight, fleet_of, propagate
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from mpc_cover.verification.motion import verify_motion
from mpc_cover.verification.path import Path
from mpc_cover.verification.report import Check, Report


@pytest.fixture(scope="module")
def flight():
    return box3_flight("plan")


def verify(flight, **changes):
    changed = replace(flight, **changes)
    fleet = flight.mission.fleet
    start = (fleet.start, np.zeros_like(fleet.start))
    return verify_motion(
        fleet, changed.time, changed.position, changed.velocity, changed.input, at_rest=True, start=start
    )


def failed(report):
    return {check.name for check in report.failures}


def test_a_good_flight_holds_in_every_respect(flight):
    report = verify(flight)
    assert report.holds
    assert report.first_failure is None
    assert [check.name for check in report.checks] == [
        "numbers",
        "dynamics of position",
        "dynamics of velocity",
        "speed",
        "input",
        "box",
        "separation",
        "connectivity",
        "rest at the end",
        "start position",
        "start velocity",
    ]
    assert all(check.margin >= 0.0 for check in report.checks)


def test_a_jump_of_one_sample_breaks_the_dynamics(flight):
    position = flight.position.copy()
    position[7, 1] += [1e-5, 0.0]
    report = verify(flight, position=position)
    assert failed(report) == {"dynamics of position"}
    assert report.first_failure.where.startswith("a2, t = ")
    assert report.first_failure.margin == pytest.approx(1e-6 - 1e-5, rel=1e-3)


def test_the_last_sample_is_looked_at_too(flight):
    position = flight.position.copy()
    position[-1, 2] += [0.0, 1e-4]
    report = verify(flight, position=position)
    assert failed(report) == {"dynamics of position"}
    assert report.first_failure.where == "a3, t = 22.500 s"


def test_a_velocity_that_does_not_follow_is_found(flight):
    velocity = flight.velocity.copy()
    velocity[12, 0] += [0.0, 1e-5]
    assert "dynamics of velocity" in failed(verify(flight, velocity=velocity))


@pytest.mark.parametrize(
    ("limit", "name", "value"),
    [("speed_max", "speed", 1.3), ("input_max", "input", 1.3)],
)
def test_limits_of_a_single_agent(flight, limit, name, value):
    fleet = flight.mission.fleet
    tight = replace(fleet, **{limit: np.array([1.5, value, 1.5])})
    report = verify_motion(tight, flight.time, flight.position, flight.velocity, flight.input)
    assert failed(report) == {name}
    assert report.first_failure.where.startswith("a2, t = ")
    assert report.first_failure.margin == pytest.approx(value - 4 / 3)


@pytest.mark.parametrize(("speed", "name"), [(1.2, "speed"), (0.0, "input")])
def test_limits_are_discs_not_squares(speed, name):
    # 1.2 on each axis is within a square of 1.5, but 1.7 together
    time, start = np.array([0.0, 0.1]), np.zeros((1, 2))
    force = np.full((1, 1, 2), 1.2 if name == "input" else 0.0)
    position, velocity = propagate(start, force, time, np.full((1, 2), speed))
    report = verify_motion(fleet_of(start), time, position, velocity, force)
    assert failed(report) == {name}
    assert report.first_failure.margin == pytest.approx(1.5 - 1.2 * np.sqrt(2.0))


def test_limit_reached_exactly_holds(flight):
    fleet = replace(flight.mission.fleet, speed_max=np.full(3, 4 / 3), input_max=np.full(3, 4 / 3))
    assert verify_motion(fleet, flight.time, flight.position, flight.velocity, flight.input).holds


def test_parabola_that_leaves_the_box_only_between_samples():
    # 1 m/s towards the wall, pushed back at 1 m/s^2: 0.5 m ahead after 1 s, back after 2 s
    time, force = np.array([0.0, 2.0]), np.array([[[-1.0, 0.0]]])
    start, speed = np.array([[9.6, 5.0]]), np.array([[1.0, 0.0]])
    position, velocity = propagate(start, force, time, speed)
    fleet = fleet_of(start, motion_max=np.array([10.0, 10.0]))
    report = verify_motion(fleet, time, position, velocity, force)
    assert failed(report) == {"box"}
    assert report.first_failure.margin == pytest.approx(-0.1)


def test_parabola_that_just_touches_the_wall_holds():
    time, force = np.array([0.0, 2.0]), np.array([[[0.0, 1.0]]])
    start, speed = np.array([[5.0, 0.5]]), np.array([[0.0, -1.0]])
    position, velocity = propagate(start, force, time, speed)
    fleet = fleet_of(start, motion_min=np.array([0.0, 0.0]))
    report = verify_motion(fleet, time, position, velocity, force)
    assert report.holds
    box = next(check for check in report.checks if check.name == "box")
    assert box.margin == pytest.approx(0.0, abs=1e-12)


def test_a_plan_that_does_not_end_at_rest(flight):
    report = verify_motion(
        flight.mission.fleet,
        flight.time[:-1],
        flight.position[:-1],
        flight.velocity[:-1],
        flight.input[:-1],
        at_rest=True,
    )
    assert failed(report) == {"rest at the end"}


@pytest.mark.parametrize(("which", "name"), [(0, "start position"), (1, "start velocity")])
def test_a_plan_that_starts_elsewhere(flight, which, name):
    fleet = flight.mission.fleet
    start = [fleet.start.copy(), np.zeros_like(fleet.start)]
    start[which][1, 0] += 2e-6
    report = verify_motion(
        fleet, flight.time, flight.position, flight.velocity, flight.input, start=(start[0], start[1])
    )
    assert failed(report) == {name}


def test_tiny_intervals_are_fine(flight):
    """A record that several agents' samples were merged into has intervals of 1e-4 s."""
    time = np.sort(np.concatenate([flight.time, flight.time[1:-1] + 1e-4]))
    index = np.searchsorted(flight.time, time[:-1], side="right") - 1
    force = flight.input[index]
    position, velocity = propagate(flight.position[0], force, time)
    report = verify_motion(flight.mission.fleet, time, position, velocity, force, at_rest=True)
    assert report.holds, report.first_failure


def test_a_long_path_in_pieces_gives_the_same_report(flight, monkeypatch):
    whole = verify(flight)
    assert len(list(Path(flight.time, flight.position, flight.velocity, flight.input).pieces())) == 1
    monkeypatch.setattr("mpc_cover.verification.path._PIECE", 7 * 9)
    pieces = list(Path(flight.time, flight.position, flight.velocity, flight.input).pieces())
    assert len(pieces) == 7
    assert pieces[0].time[-1] == pieces[1].time[0]
    assert pieces[-1].time[-1] == flight.time[-1]
    assert verify(flight) == whole


def test_what_is_not_asked_for_is_not_reported(flight):
    fleet = replace(flight.mission.fleet, separation_min=0.0, communication_range=np.inf)
    report = verify_motion(fleet, flight.time, flight.position, flight.velocity, flight.input)
    assert report.holds
    assert not {"separation", "connectivity", "rest at the end"} & {check.name for check in report.checks}


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, 1e300])
@pytest.mark.parametrize("name", ["time", "position", "velocity", "input"])
def test_numbers_that_are_not_finite_fail_everything(flight, name, bad):
    array = getattr(flight, name).copy()
    array.flat[-1] = bad
    report = verify(flight, **{name: array})
    assert not any(check.holds for check in report.checks)
    assert len(report.checks) == len(verify(flight).checks)
    assert report.first_failure.name == "numbers"
    assert report.first_failure.where.startswith(f"{name}[")


def test_nan_in_the_start_fails(flight):
    fleet = flight.mission.fleet
    start = (np.full_like(fleet.start, np.nan), np.zeros_like(fleet.start))
    report = verify_motion(fleet, flight.time, flight.position, flight.velocity, flight.input, start=start)
    assert report.first_failure.where.startswith("start position[0, 0]")


@pytest.mark.parametrize("name", ["position", "velocity", "input", "time"])
def test_wrong_shapes_fail(flight, name):
    report = verify(flight, **{name: getattr(flight, name)[:-1]})
    assert report.first_failure.name == "numbers"
    assert "has shape" in report.first_failure.where


def test_one_sample_is_no_motion(flight):
    report = verify(
        flight,
        time=flight.time[:1],
        position=flight.position[:1],
        velocity=flight.velocity[:1],
        input=flight.input[:0],
    )
    assert "two samples" in report.first_failure.where


def test_time_that_stands_still_fails(flight):
    time = flight.time.copy()
    time[4] = time[3]
    report = verify(flight, time=time)
    assert report.first_failure.where == "time[4] is not after the one before"


wild = arrays(float, array_shapes(min_dims=0, max_dims=3, max_side=3), elements=st.floats())


@given(wild, wild, wild, wild)
def test_nothing_makes_the_verifier_raise(time, position, velocity, force):
    fleet = fleet_of(np.array([[0.0, 0.0], [1.0, 0.0]]), separation_min=0.5, communication_range=2.0)
    assert not verify_motion(fleet, time, position, velocity, force).holds


@given(
    arrays(float, 3, elements=st.floats(), unique=True),
    arrays(float, (3, 2, 2), elements=st.floats()),
    arrays(float, (3, 2, 2), elements=st.floats()),
    arrays(float, (2, 2, 2), elements=st.floats()),
)
def test_nothing_of_the_right_shape_makes_it_raise_either(time, position, velocity, force):
    fleet = fleet_of(np.array([[0.0, 0.0], [1.0, 0.0]]), separation_min=0.5, communication_range=2.0)
    report = verify_motion(fleet, np.sort(time), position, velocity, force, at_rest=True)
    assert isinstance(report.holds, bool)


def test_an_empty_report_vouches_for_nothing():
    assert not Report(()).holds


def test_report_as_plain_data_has_no_infinity():
    report = Report((Check("a", True, 0.5, "m", "here"), Check("b", False, -np.inf, "m", "there")))
    assert report.to_dict() == {
        "holds": False,
        "checks": [
            {"name": "a", "holds": True, "margin": 0.5, "unit": "m", "where": "here"},
            {"name": "b", "holds": False, "margin": None, "unit": "m", "where": "there"},
        ],
    }
    assert str(report.first_failure) == "b: FAILS, margin -inf m (there)"
