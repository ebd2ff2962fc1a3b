"""The verifier of a file: the motion, its start, its cells, and the honesty of its coverage."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from flights import box3_flight, mission_of, random_walk, trajectory_of

from mpc_cover.verification.check import check_trajectory
from mpc_cover.verification.coverage_claim import first_measured


@pytest.fixture(scope="module")
def flight():
    return box3_flight()


def failed(trajectory):
    return {check.name: check for check in check_trajectory(trajectory).failures}


def test_an_honest_flight_holds(flight):
    assert check_trajectory(flight).holds


def test_a_cell_claimed_that_was_never_measured(flight):
    covered_at = flight.covered_at.copy()
    covered_at[np.isinf(covered_at)] = 22.5
    found = failed(replace(flight, covered_at=covered_at))
    assert set(found) == {"coverage claimed"}
    check = found["coverage claimed"]
    assert check.margin == -np.inf
    assert check.where == "cell 0 at (0.25, 0.25) and 5 more: claimed covered at t = 22.500 s, was never measured"


def test_a_cell_claimed_too_early(flight):
    covered_at = flight.covered_at.copy()
    covered_at[200] -= 0.5
    found = failed(replace(flight, covered_at=covered_at))
    assert set(found) == {"coverage claimed"}
    assert found["coverage claimed"].margin == pytest.approx(-0.5)


def test_a_cell_claimed_too_late(flight):
    covered_at = flight.covered_at.copy()
    covered_at[200] += 0.5
    found = failed(replace(flight, covered_at=covered_at))
    assert set(found) == {"coverage kept"}
    assert "claimed covered at" in found["coverage kept"].where


def test_a_cell_covered_but_not_claimed(flight):
    covered_at = flight.covered_at.copy()
    covered_at[200] = np.inf
    found = failed(replace(flight, covered_at=covered_at))
    assert set(found) == {"coverage kept"}
    assert "claimed never covered, was measured at" in found["coverage kept"].where


def test_the_rim_of_a_disc_counts(flight):
    distance = np.linalg.norm(flight.position[:, :, None] - flight.cell, axis=3).min(axis=(0, 1))
    inside, outside = np.flatnonzero((distance > 0.93) & (distance <= 1.0)), np.flatnonzero(distance > 1.0)
    assert inside.size
    covered_at = flight.covered_at.copy()
    covered_at[inside] = np.inf
    assert set(failed(replace(flight, covered_at=covered_at))) == {"coverage kept"}
    covered_at = flight.covered_at.copy()
    covered_at[outside[np.argmin(distance[outside])]] = flight.time[-1]
    assert set(failed(replace(flight, covered_at=covered_at))) == {"coverage claimed"}


def test_nan_in_the_claim_fails(flight):
    covered_at = flight.covered_at.copy()
    covered_at[3] = np.nan
    assert {"coverage claimed", "coverage kept"} <= set(failed(replace(flight, covered_at=covered_at)))


def test_cells_of_another_mission_fail(flight):
    cell = flight.cell.copy()
    cell[17] += [0.1, 0.0]
    check = failed(replace(flight, cell=cell))["cells of the mission"]
    assert check.where == "cell 17"
    assert check.margin == pytest.approx(-0.1)


def test_fewer_cells_than_the_mission_has_fail(flight):
    found = failed(replace(flight, cell=flight.cell[:-1], covered_at=flight.covered_at[:-1]))
    assert set(found) == {"cells of the mission", "coverage claimed", "coverage kept"}


def test_a_flight_that_starts_elsewhere_fails(flight):
    moved = replace(flight, position=flight.position + 1e-3)
    assert "start position" in failed(moved)


@pytest.mark.parametrize(("kind", "names"), [("simulate", set()), ("demo", set()), ("plan", {"rest at the end"})])
def test_only_a_plan_must_end_at_rest(kind, names):
    flight = box3_flight(kind)
    cut = trajectory_of(flight.mission, flight.input[:-1], kind)
    assert set(failed(cut)) == names


def test_broken_numbers_leave_nothing_standing(flight):
    position = flight.position.copy()
    position[5, 1, 0] = np.nan
    report = check_trajectory(replace(flight, position=position))
    assert not any(check.holds for check in report.checks)
    assert report.first_failure.where.startswith("position[5, 1, 0]")


def test_every_magnitude_counts():
    raw = {
        "schema": 1,
        "name": "two",
        "area": {"shape": {"kind": "box", "min_m": [0, 0], "max_m": [6, 4]}, "cell_size_m": 0.5},
        "magnitudes": ["wind", "heat"],
        "fleet": {
            "defaults": {"input_max_m_per_s2": 1.5, "speed_max_m_per_s": 1.5},
            "agents": [
                {"id": "a1", "start_m": [1, 1], "sensing_radius_m": {"wind": 1.0}},
                {"id": "a2", "start_m": [3, 2], "sensing_radius_m": {"wind": 0.8, "heat": 1.2}},
            ],
        },
    }
    flight = random_walk(mission_of(raw), 40)
    names = {"coverage claimed", "coverage kept"}
    assert not names & set(failed(flight))
    # what the first agent saw of the wind alone is not covered
    wind = first_measured(flight, flight.mission.fleet.radius[:, :1])
    assert (np.isfinite(wind) & np.isinf(flight.covered_at)).any()
    assert "coverage claimed" in failed(replace(flight, covered_at=wind))


def test_a_cell_at_exactly_the_radius_is_covered():
    raw = {
        "schema": 1,
        "name": "edge",
        "area": {
            "shape": {"kind": "box", "min_m": [0, 0], "max_m": [2, 1]},
            "cell_size_m": 1.0,
            "motion_min_m": [-1, -1],
            "motion_max_m": [3, 3],
        },
        "fleet": {
            "defaults": {"sensing_radius_m": 1.0, "input_max_m_per_s2": 1.0, "speed_max_m_per_s": 1.0},
            "agents": [{"id": "a1", "start_m": [0.5, 1.5]}],
        },
    }
    flight = trajectory_of(mission_of(raw), np.zeros((2, 1, 2)))
    np.testing.assert_array_equal(flight.covered_at, [0.0, np.inf])
    assert check_trajectory(flight).holds
    # which way rounding went at the tie is nobody's fault
    nudged = trajectory_of(mission_of(raw), np.zeros((2, 1, 2)))
    nudged.position[...] += [0.0, 1e-9]
    assert not {"coverage claimed", "coverage kept"} & set(failed(nudged))
    assert not {"coverage claimed", "coverage kept"} & set(failed(replace(nudged, covered_at=np.full(2, np.inf))))
