"""Single integrators may jump in velocity, and in nothing else."""

from dataclasses import replace

import numpy as np
import pytest
from flights import covered_at, mission_of

from mpc_cover.mission.load import load_mission
from mpc_cover.trajectory_file import Recording
from mpc_cover.verification.check import check_trajectory


@pytest.fixture
def flight():
    """Two agents a few straight steps apart, turning at every sample."""
    raw = load_mission("box-3").spec.model_dump(by_alias=True, exclude_none=True)
    raw["fleet"]["dynamics"] = "single"
    mission = mission_of(raw)
    angle = np.linspace(0.0, 3.0, 7)
    velocity = np.stack([np.cos(angle), np.sin(angle)], axis=1)[:, None] * np.ones((1, 3, 1))
    time = 0.5 * np.arange(8)
    position = np.concatenate([np.zeros((1, 3, 2)), np.cumsum(0.5 * velocity, axis=0)]) + mission.fleet.start
    velocity = np.concatenate([velocity, np.zeros((1, 3, 2))])
    covered = covered_at(time, position, mission)
    return Recording(
        *(time, position, velocity, np.zeros((7, 3, 2))),
        cell=mission.field.cell,
        covered_at=covered,
        agent_id=mission.fleet.ids,
        mission=mission,
        meta={"kind": "simulate"},
    )


def failures(trajectory):
    return [check.name for check in check_trajectory(trajectory).failures]


def test_straight_steps_hold(flight):
    report = check_trajectory(flight)
    assert report.holds, str(report.first_failure)
    assert not {"dynamics of velocity", "input"} & {check.name for check in report.checks}


def test_double_integrators_may_not(flight):
    double = flight.mission.spec.model_copy(
        update={"fleet": flight.mission.spec.fleet.model_copy(update={"dynamics": "double"})}
    )
    assert "dynamics of velocity" in failures(replace(flight, mission=replace(flight.mission, spec=double)))


@pytest.mark.parametrize(
    ("name", "change", "expected"),
    [
        ("velocity", 2.0, ["dynamics of position", "speed"]),
        ("position", 1.001, ["dynamics of position"]),
    ],
)
def test_what_does_not_follow_fails(flight, name, change, expected):
    assert set(expected) <= set(failures(replace(flight, **{name: change * getattr(flight, name)})))


def test_a_force_has_nothing_to_act_on(flight):
    pushed = replace(flight, input=np.full_like(flight.input, 1e-9))
    assert "no input" in failures(pushed)
    broken = replace(flight, position=np.full_like(flight.position, np.nan))
    assert "numbers" in failures(broken)
