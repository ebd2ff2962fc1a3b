"""After a loss the others must stay connected among themselves; before it everybody must."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from flights import covered_at, propagate

from mpc_cover.mission.load import build_mission, load_mission
from mpc_cover.trajectory_file import Recording
from mpc_cover.verification.check import check_trajectory


def flight(lost, separation=0.5):
    """Three in a row, 2 m apart with a range of 2.5 m; from 2 s on the two on the left leave the third behind."""
    spec = load_mission("box-3").spec.model_dump(by_alias=True, exclude_none=True)
    for agent, x in zip(spec["fleet"]["agents"], (4.0, 6.0, 8.0), strict=True):
        agent["start_m"] = [x, 5.0]
    spec["fleet"] |= {"communication_range_m": 2.5, "separation_min_m": separation}
    mission = build_mission(spec, "mission")
    time = np.arange(9) * 0.5
    force = np.zeros((8, 3, 2))
    force[4:6, :2, 0] = -1.0
    force[6:, :2, 0] = 1.0
    position, velocity = propagate(mission.fleet.start, force, time)
    first = covered_at(time, position, mission)
    return Recording(
        *(time, position, velocity, force),
        cell=mission.field.cell,
        covered_at=first,
        agent_id=mission.fleet.ids,
        mission=mission,
        meta={"kind": "demo", **lost},
    )


def test_leaving_a_living_agent_behind_fails():
    report = check_trajectory(flight({}))
    assert report.first_failure.name == "connectivity"


def test_leaving_a_dead_one_behind_holds():
    report = check_trajectory(flight({"lost": {"a3": 2.0}}))
    assert report.holds, report.first_failure


@pytest.mark.parametrize(
    "lost", [{"a3": 3.9}, {"a1": 0.5}, {"nobody": 0.0}, {"a3": "early"}, "a3", {"a3": float("nan")}]
)
def test_what_was_lost_too_late_or_never_is_no_excuse(lost):
    assert not check_trajectory(flight({"lost": lost})).holds


def test_a_lost_agent_is_still_an_obstacle():
    """The third is told to have died, and another flies through it."""
    good = flight({"lost": {"a3": 0.0}})
    force = good.input.copy()
    force[:] = 0.0
    force[:2, :2, 0], force[3:5, :2, 0] = 1.5, -1.5
    position, velocity = propagate(good.mission.fleet.start, force, good.time)
    bad = replace(
        good,
        position=position,
        velocity=velocity,
        input=force,
        covered_at=covered_at(good.time, position, good.mission),
    )
    assert "separation" in {check.name for check in check_trajectory(bad).failures}


def relay_lost(pushes):
    """Three in a row, 2 m apart with a range of 2.5 m; the middle one dies at 0.9 s, and the outer ones fly on.

    `pushes` is how the left one accelerates, once a period [m/s^2]; the right one does so the other way round.
    """
    good = flight({"lost": {"a2": 0.9}})
    force = np.zeros((len(pushes), 3, 2))
    force[:, 0, 0], force[:, 2, 0] = pushes, -np.array(pushes)
    time = np.arange(len(pushes) + 1) * 0.5
    position, velocity = propagate(good.mission.fleet.start, force, time)
    return replace(
        good,
        time=time,
        position=position,
        velocity=velocity,
        input=force,
        covered_at=covered_at(time, position, good.mission),
    )


MEET = [0.0, -0.2, 0.2, 0.6, 0.2, 0.0, 0.0, 0.0, -0.8]
"""Apart at first, as before the loss; by 1.5 s at rest again, then towards each other."""


def together_again(report):
    return next((check for check in report.checks if check.name == "together again after a loss"), None)


def test_whom_the_loss_of_a_relay_leaves_apart_may_be_so_until_they_meet():
    report = check_trajectory(relay_lost(MEET))
    assert report.holds, report.failures
    said = str(together_again(report))
    assert "after the loss at t = 0.90 s the others were apart for" in said
    assert "by 4.100 m" in said


def test_but_they_must_meet():
    report = check_trajectory(relay_lost([0.0, -0.2, 0.2, 0.6, -0.6, 0.0, 0.0]))
    assert "connectivity" in {check.name for check in report.failures}
    assert together_again(report) is None


def test_unless_the_record_ends_before_they_could_notice():
    """The middle one dies when everyone has come to rest, and the mission is over, or goes on."""
    died_at_the_end = relay_lost([0.0] * 3)
    report = check_trajectory(died_at_the_end)
    assert report.holds, report.failures
    assert "the end of the record: too soon to meet" in str(together_again(report))
    assert not check_trajectory(relay_lost([0.0] * 12)).holds


def test_and_come_no_farther_apart_once_they_could_know():
    """They rest until 3 s, part again, and meet at last."""
    apart = [0.0] * 6 + [-0.4, 0.4]
    meet = [0.8, 0.0, 0.0, -0.8, 0.8, 0.0, 0.0, -0.8]
    assert check_trajectory(relay_lost([0.0] * 8 + meet)).holds
    report = check_trajectory(relay_lost(apart + meet))
    assert "connectivity" in {check.name for check in report.failures}


def test_nothing_is_said_of_losses_that_leave_everyone_in_touch():
    assert together_again(check_trajectory(flight({"lost": {"a3": 2.0}}))) is None


def test_whoever_was_lost_before_the_record_begins_had_measured_where_it_stands():
    early = flight({"lost": {"a3": -2.0}})
    assert check_trajectory(early).holds
    disc = np.linalg.norm(early.cell - early.position[0, 2], axis=1) <= 1.0
    assert (early.covered_at[disc] == 0.0).all()
    unseen = replace(early, covered_at=np.where(disc, np.inf, early.covered_at))
    assert "coverage kept" not in {check.name for check in check_trajectory(unseen).failures}
