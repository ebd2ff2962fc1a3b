"""Planted violations: each is caught, by the check that is meant to; valid copies of valid motions pass."""

from __future__ import annotations

import numpy as np
import pytest
from planted_claims import CLAIMS, MISSIONS, SEALS
from planted_flights import (
    as_it_is_read,
    bereaved,
    copied,
    flown,
    later,
    legs,
    moved,
    renumbered,
    single,
    thinned,
    torn,
    written,
)
from planted_motions import LOSSES, MOTION

from mpc_cover.record_seal import sealed
from mpc_cover.verification.check import check_trajectory
from mpc_cover.verification.summary import summarise

LOST_3 = (("a3", 2.0),)


PLANTED = {
    **{f"motion: {name}": each for name, each in MOTION.items()},
    **{f"loss: {name}": each for name, each in LOSSES.items()},
    **{f"claim: {name}": each for name, each in CLAIMS.items()},
    **{f"mission: {name}": each for name, each in MISSIONS.items()},
    **{f"seal: {name}": ("record as it was written", each) for name, each in SEALS.items()},
}


def test_there_are_enough_of_them():
    assert len(PLANTED) >= 100


@pytest.mark.parametrize("name", PLANTED)
def test_it_is_caught(name):
    by, plant = PLANTED[name]
    planted = plant()
    recording, mission = planted if isinstance(planted, tuple) else (planted, None)
    report = check_trajectory(recording, mission)
    assert by in {check.name for check in report.failures}


@pytest.mark.parametrize("name", [name for name in PLANTED if name.startswith("mission: ")])
def test_whoever_edits_the_mission_along_is_believed_only_without_another_one(name):
    """Most of them: the file's own mission is one that its motion may fly."""
    recording, mission = PLANTED[name][1]()
    assert not check_trajectory(recording, mission).holds
    by = PLANTED[name][0]
    assert by not in {check.name for check in check_trajectory(recording).failures}


VALID = {
    "a flight": flown,
    "of a fleet that lost one": bereaved,
    "a plan": lambda: legs("plan"),
    "several looks": lambda: flown("looks"),
    "effective coverage": lambda: flown("effective"),
    "continuous sensing": lambda: flown("continuous"),
    "a patrol": lambda: flown("patrol"),
    "single integrators": single,
    "a volume": lambda: flown("volume"),
    "a fleet torn apart by a death": lambda: torn(LOST_3),
    "sealed": lambda: as_it_is_read(written()),
}


COPIES = {
    "as it is": lambda flight: flight,
    "in single precision": copied,
    "thinned": thinned,
    "thinned in single precision": lambda flight: copied(thinned(flight)),
    "late and in single precision": lambda flight: copied(later(flight, 100.3)),
    "late, thinned, in single precision": lambda flight: copied(thinned(later(flight, 100.3))),
    "renumbered": lambda flight: renumbered(flight, np.roll(np.arange(flight.mission.fleet.size), 1)),
    "moved": lambda flight: moved(flight, 1e4 * np.arange(1.0, 1.0 + flight.position.shape[2])),
    "moved far": lambda flight: moved(flight, -1e7 * np.arange(1.0, 1.0 + flight.position.shape[2])),
}


@pytest.mark.parametrize("copy", COPIES)
@pytest.mark.parametrize("name", VALID)
def test_valid_motions_pass_however_they_are_copied(name, copy):
    flight = VALID[name]()
    made = COPIES[copy](flight)
    if name == "sealed" and copy not in {"as it is", "in single precision"}:
        made = sealed(made)  # another record: whoever makes it seals it
    report = check_trajectory(made)
    assert report.holds, [str(check) for check in report.failures]


@pytest.mark.parametrize("name", ["all dead", "all dead but one", "a living one called dead", "a word"])
def test_figures_are_made_of_it_all_the_same(name):
    recording = LOSSES[name][1]()
    assert not summarise(recording, check_trajectory(recording)).holds


def test_agents_are_told_apart_by_their_ids_not_by_their_numbers():
    flight = bereaved()
    report = check_trajectory(renumbered(flight, (2, 0, 1)), flight.mission)
    assert report.holds, report.failures
