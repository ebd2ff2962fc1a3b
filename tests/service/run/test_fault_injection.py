"""Agents that a user lets die: the words for it, and that the others finish whatever they were to the fleet."""

from __future__ import annotations

import numpy as np
import pytest
from service_fakes import small_mission
from sweep_laws import SharingLaw

from mpc_cover.errors import InvalidInputError
from mpc_cover.mission.load import build_mission, load_mission
from mpc_cover.service.run.fault_injection import parse_kills
from mpc_cover.service.run.simulate import simulate
from mpc_cover.verification.check import check_trajectory


def row_mission(starts, size=(6.0, 3.0), reach=2.5, cell=1.0):
    """Return a mission whose agents start in a row."""
    raw = {
        "schema": 1,
        "name": "row",
        "area": {"shape": {"kind": "box", "min_m": [0.0, 0.0], "max_m": list(size)}, "cell_size_m": cell},
        "fleet": {
            "defaults": {"sensing_radius_m": 1.0, "input_max_m_per_s2": 1.5, "speed_max_m_per_s": 1.5},
            "agents": [{"id": f"a{i + 1}", "start_m": [x, 1.5]} for i, x in enumerate(starts)],
            "separation_min_m": 0.5,
            "communication_range_m": reach,
        },
        "control": {"period_s": 0.5, "horizon_steps": 12, "time_limit_s": 60.0},
    }
    return build_mission(raw, "row")


def test_words_become_deaths():
    assert parse_kills(["a2@6.5", "a1@3"], load_mission("box-3")) == {"a2": 6.5, "a1": 3.0}
    assert parse_kills([], load_mission("box-3")) == {}


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["a2"], "AGENT@SECONDS"),
        (["a2@soon"], "AGENT@SECONDS"),
        (["@3"], "AGENT@SECONDS"),
        (["a2@nan"], "AGENT@SECONDS"),
        (["a9@3"], "there is no a9: agents are a1, a2, a3"),
        (["a2@-1"], "later than 0 s"),
        (["a2@0"], "later than 0 s"),
        (["a2@inf"], "later than 0 s"),
        (["a2@1", "a2@2"], "dies once only"),
        (["a1@1", "a2@2", "a3@3"], "somebody must be left"),
    ],
)
def test_what_cannot_be_is_said(words, said):
    with pytest.raises(InvalidInputError, match="--kill") as caught:
        parse_kills(words, load_mission("box-3"))
    assert said in str(caught.value)


def test_a_simulation_in_which_nobody_is_left_is_refused():
    mission = small_mission()
    with pytest.raises(InvalidInputError, match="somebody must be left"):
        simulate(mission, law=SharingLaw(mission), deaths={"a1": 1.0, "a2": 1.0})


@pytest.fixture(scope="module")
def without_relay():
    """Three in a row; the one in the middle dies, which leaves the others twice as far apart as they can hear."""
    mission = row_mission([1.0, 3.0, 5.0])
    return simulate(mission, deaths={"a2": 0.8})


def test_those_whom_a_relay_leaves_apart_meet_and_finish(without_relay):
    assert without_relay.complete
    assert without_relay.lost == ("a2",)
    report = check_trajectory(without_relay.trajectory)
    assert report.holds, report.failures
    said = next(check for check in report.checks if check.name == "together again after a loss")
    assert "the others were apart for" in str(said)


def test_they_turn_to_each_other_within_two_periods(without_relay):
    died = without_relay.trajectory.meta["lost"]["a2"]
    turned = next(step for step in without_relay.steps if step.reason == "rendezvous")
    assert turned.mission_time_s <= died + 2.0 * 0.5 + 1e-6


def test_then_they_come_nearer_all_the_time(without_relay):
    trajectory = without_relay.trajectory
    turned = next(step for step in without_relay.steps if step.reason == "rendezvous").mission_time_s
    apart = np.linalg.norm(trajectory.position[:, 0] - trajectory.position[:, 2], axis=1)
    while_apart = apart[(trajectory.time >= turned + 1.0) & (apart > 2.5)]  # a second is what braking takes
    assert while_apart.size
    assert (np.diff(while_apart) <= 1e-9).all()


def test_a_mission_ends_when_only_the_lost_could_have_measured_the_rest():
    agents = [
        {"id": "a1", "start_m": [1.0, 1.5], "sensing_radius_m": {"heat": 1.0}},
        {"id": "a2", "start_m": [3.0, 1.5], "sensing_radius_m": {"salt": 1.0}},
    ]
    raw = row_mission([1.0, 3.0], size=(4.0, 3.0)).spec.model_dump(by_alias=True, exclude_none=True)
    raw["fleet"]["agents"], raw["magnitudes"] = agents, ["heat", "salt"]
    del raw["fleet"]["defaults"]["sensing_radius_m"]
    mission = build_mission(raw, "row")
    result = simulate(mission, deaths={"a2": 1.0})
    assert not result.complete
    assert "cells are not reported as covered, and cannot be without a2" in result.outcome
    assert result.trajectory.time[-1] < 30.0
    heat = mission.field.cell[:, None] - result.trajectory.position[None, :, 0]
    assert (np.linalg.norm(heat, axis=2).min(axis=1) <= 1.0 + 1e-6).all()
    assert check_trajectory(result.trajectory).holds


def scattered(seed):
    """Return a mission with two to six agents at connected random places, and one or two deaths."""
    rng = np.random.default_rng(seed)
    agents, reach = 2 + seed % 5, float(rng.choice([3.5, 4.5, 5.5]))
    places = [rng.uniform(1.0, 9.0, 2)]
    while len(places) < agents:
        place = rng.uniform(1.0, 9.0, 2)
        distance = np.linalg.norm(np.array(places) - place, axis=1)
        if distance.min() > 1.0 and distance.min() < reach - 0.5:
            places.append(place)
    raw = row_mission([1.0, 3.0], size=(10.0, 10.0), reach=reach, cell=0.5).spec.model_dump(
        by_alias=True, exclude_none=True
    )
    raw["fleet"]["agents"] = [{"id": f"a{i + 1}", "start_m": place.tolist()} for i, place in enumerate(places)]
    raw["control"] |= {"horizon_steps": 20, "time_limit_s": 120.0}
    who = rng.choice(agents, min(agents - 1, 1 + seed % 2), replace=False)
    return build_mission(raw, "scattered"), {f"a{i + 1}": float(rng.uniform(0.3, 9.0)) for i in who}


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(20))
def test_whoever_dies_whenever_the_others_finish(seed):
    mission, deaths = scattered(seed)
    result = simulate(mission, deaths=deaths)
    assert result.complete, result.outcome
    report = check_trajectory(result.trajectory)
    assert report.holds, report.failures
