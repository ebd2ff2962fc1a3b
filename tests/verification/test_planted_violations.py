"""Planted violations: each is caught, by the check that is meant to; valid copies of valid motions pass."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from planted_flights import (
    THREE,
    agents_with,
    as_it_is_read,
    bereaved,
    claimed_anew,
    copied,
    edited,
    flown,
    leg,
    legs,
    mission_with,
    moved,
    propagate,
    reflown,
    renumbered,
    split,
    thinned,
    torn,
    written,
)

from mpc_cover.mission.load import build_mission
from mpc_cover.record_seal import sealed
from mpc_cover.verification.check import check_trajectory
from mpc_cover.verification.summary import summarise

LOST_3 = (("a3", 2.0),)


def changed(recording, name, index, value):
    """Return the recording with other numbers at an index of an array."""
    array = getattr(recording, name).copy()
    array[index] = value(array[index]) if callable(value) else value
    return replace(recording, **{name: array})


def at_samples(recording, keep):
    """Return the recording with these samples, by index, the inputs as they follow each."""
    kept = {name: getattr(recording, name)[keep] for name in ("time", "position", "velocity")}
    return replace(recording, **kept, input=recording.input[np.minimum(keep[:-1], len(recording.input) - 1)])


def along(start, forces, kind="simulate", **sections):
    """Return the flight of three from their starts (3, 2) [m], one input (3, 2) a period, in a wider mission."""
    agents = [{"id": f"a{i + 1}", "start_m": list(place)} for i, place in enumerate(start)]
    raw = {**THREE, "fleet": {**THREE["fleet"], "agents": agents, "communication_range_m": 3.0}}
    mission = mission_with(build_mission(raw, "along"), **sections)
    time = mission.spec.control.period_s * np.arange(len(forces) + 1)
    position, velocity = propagate(mission.fleet.start, np.array(forces, dtype=float), time)
    blank = legs(kind)
    flight = replace(blank, time=time, position=position, velocity=velocity, input=np.array(forces, dtype=float))
    return claimed_anew(replace(flight, mission=mission, agent_id=mission.fleet.ids))


def smuggled(name, way):
    """Return a flight in 5,000 samples whose residuals, each below the tolerance, move an agent by millimetres."""
    fine = split(legs(), 500)
    drift = 6e-7 * way(np.arange(len(fine.time)))
    return claimed_anew(changed(fine, name, (slice(None), 0, 0), lambda old: old + drift))


def coarse():
    """Return a flight on a clock of which single precision holds sixteenths of a second, and motion smuggled in it."""
    fine = split(legs(), 8)
    drift = 1e-4 * np.arange(len(fine.time))
    late = replace(fine, time=fine.time + 2.0**19, covered_at=fine.covered_at + 2.0**19)
    return claimed_anew(copied(changed(late, "position", (slice(None), 0, 0), lambda old: old + drift)))


def meta(recording, **facts):
    return replace(recording, meta={**recording.meta, **facts})


def lost(recording, **times):
    return meta(recording, lost=times)


def braking(share, *, turn=0.0):
    """Return a flight of which the third is said to die at 1 s, at full speed: it brakes with a share of its input."""
    force = np.zeros((8, 3, 2))
    force[:2, :, 1] = 0.5
    force[2:4, :2, 1] = -0.5
    force[2:, 2, 1] = 0.0
    flight = along([(0.5, 0.5), (1.2, 0.5), (1.9, 0.5)], force)
    h, left = 0.5, flight.velocity[2, 2].copy()
    for k in range(2, 8):
        force[k, 2] = -left * min(share / np.linalg.norm(left), 1.0 / h) if np.linalg.norm(left) > 1e-12 else 0.0
        force[k, 2, 0] += turn * (1.0 if k == 2 else -1.0 if k == 3 else 0.0)
        left = left + h * force[k, 2]
    return lost(reflown(flight, force), a3=1.0)


def dead_covers():
    """Return the flight in which one dies in flight, and its braking and resting is claimed to measure."""
    flight = bereaved()
    assert (claimed_anew(flight).covered_at < flight.covered_at).any()
    return claimed_anew(flight)


MOTION = {
    "nan": ("numbers", lambda: changed(flown(), "position", (3, 1, 0), np.nan)),
    "infinite": ("numbers", lambda: changed(flown(), "velocity", (3, 1, 0), np.inf)),
    "nan input": ("numbers", lambda: changed(flown(), "input", (3, 1, 0), np.nan)),
    "beyond all numbers": ("numbers", lambda: changed(flown(), "position", (3, 1, 0), 1e12)),
    "reversed time": ("numbers", lambda: replace(flown(), time=flown().time[::-1].copy())),
    "a moment twice": ("numbers", lambda: at_samples(flown(), np.r_[0:6, 5, 6 : len(flown().time)])),
    "moments exchanged": ("numbers", lambda: changed(flown(), "time", [4, 5], lambda old: old[::-1])),
    "no time": ("numbers", lambda: changed(flown(), "time", 4, np.nan)),
    "a sample elsewhere": ("dynamics of position", lambda: changed(flown(), "position", (9, 1), lambda q: q + 1e-3)),
    "elsewhere from then on": (
        "dynamics of position",
        lambda: changed(flown(), "position", slice(9, None), lambda q: q + 2e-3),
    ),
    "the smallest step aside": (
        "dynamics of position",
        lambda: changed(flown(), "position", (slice(9, None), 2, 1), lambda q: q + 3e-6),
    ),
    "faster all at once": (
        "dynamics of velocity",
        lambda: changed(flown(), "velocity", (slice(9, None), 0), lambda v: v + 1e-4),
    ),
    "speeds made smaller": ("dynamics of position", lambda: replace(flown(), velocity=0.9 * flown().velocity)),
    "inputs made smaller": ("dynamics of velocity", lambda: replace(flown(), input=0.9 * flown().input)),
    "inputs of another": ("dynamics of velocity", lambda: replace(flown(), input=flown().input[:, ::-1])),
    "a sample left out": ("dynamics of velocity", lambda: at_samples(flown(), np.delete(np.arange(31), 15))),
    "told faster than flown": ("dynamics of position", lambda: replace(flown(), time=0.9 * flown().time)),
    "told slower than flown": ("dynamics of position", lambda: replace(flown(), time=1.1 * flown().time)),
    "agents change places": (
        "dynamics of position",
        lambda: changed(flown(), "position", (slice(12, None), [0, 1]), lambda q: q[:, ::-1]),
    ),
    "position smuggled in": ("residuals of position in sum", lambda: smuggled("position", lambda n: n)),
    "there and back": (
        "residuals of position in sum",
        lambda: smuggled("position", lambda n: np.minimum(n, n[-1] - n)),
    ),
    "speed smuggled in": ("residuals of velocity in sum", lambda: smuggled("velocity", lambda n: n)),
    "smuggled in as single precision": ("residuals of position in sum", coarse),
    "too fast": ("speed", lambda: along(legs().position[0], leg(np.tile([0.0, 1.6], (3, 1)), 0.5, 2, 1))),
    "a hair too fast": ("speed", lambda: check_by(legs(), agents_with(legs().mission, speed_max_m_per_s=0.249))),
    "too hard": ("input", lambda: along(legs().position[0], leg(np.tile([0.0, 0.7], (3, 1)), 0.5, 1, 1))),
    "out of the box": ("box", lambda: along(legs().position[0], leg(np.tile([0.0, -0.6], (3, 1)), 0.5, 2, 2))),
    "out between samples": ("box", lambda: along([(0.75, 0.05), (1.5, 0.5), (1.5, 1.2)], dip())),
    "too near": ("separation", lambda: along([(0.5, 0.5), (1.2, 0.5), (1.9, 0.5)], near())),
    "too near between samples": ("separation", lambda: along([(0.5, 0.5), (0.98, 0.5), (2.5, 2.5)], crossing())),
    "out of touch": ("connectivity", torn),
    "out of touch between samples": ("connectivity", lambda: check_by(swing(), range_of(swing(), 1.03))),
    "a link torn": ("links kept", lambda: check_by(torn(), linked(torn()))),
    "starts elsewhere": ("start position", lambda: claimed_anew(replace(flown(), position=flown().position + 1e-3))),
    "one starts elsewhere": (
        "start position",
        lambda: reflown(flown(), flown().input, start=flown().position[0] + [[0, 0], [0, 0], [1e-4, 0]]),
    ),
    "starts in motion": (
        "start velocity",
        lambda: reflown(flown(), flown().input, velocity=flown().velocity[0] + [0.0, 1e-3]),
    ),
    "the beginning cut off": ("start position", lambda: claimed_anew(at_samples(flown(), np.arange(5, 31)))),
}


def dip():
    """Return inputs that swing the first below the edge of its box within a period, and above it at the samples."""
    force = np.zeros((6, 3, 2))
    force[:3, 0, 1] = -0.4, 0.8, -0.4
    return force


def near():
    """Return inputs with which the outer two come too near to the middle one."""
    return leg([[0.45, 0.0], [0.0, 0.0], [0.0, 0.0]], 0.5, 2, 2)


def crossing():
    """Return inputs with which the first swings towards the second, and is as far as it may be at every sample."""
    force = np.zeros((6, 3, 2))
    force[:3, 0, 0] = 0.5, -1.0, 0.5
    return force


def swing():
    """Return three in a row of whom the third swings outward between samples."""
    return along([(0.5, 0.5), (1.5, 0.5), (2.5, 0.5)], out_and_back())


def out_and_back():
    force = np.zeros((6, 3, 2))
    force[:3, 2, 0] = 0.2, -0.4, 0.2
    return force


def range_of(recording, reach):
    return mission_with(recording.mission, fleet={"communication_range_m": reach})


def linked(recording):
    return mission_with(recording.mission, fleet={"links": [["a2", "a3"]]})


def check_by(recording, mission):
    """Return the recording that is to be judged by this mission, as its own is laxer."""
    return recording, mission


LOSSES = {
    "a living one called dead": ("evidence of losses", lambda: lost(flown(), a3=1.0)),
    "dead before take-off": ("evidence of losses", lambda: lost(flown(), a1=-3.0)),
    "dead at take-off": ("evidence of losses", lambda: lost(flown(), a1=0.0)),
    "dead between samples": ("evidence of losses", lambda: lost(flown(), a2=1.05)),
    "all dead but one": ("evidence of losses", lambda: lost(flown(), a1=0.5, a2=0.5)),
    "all dead": ("evidence of losses", lambda: lost(flown(), a1=0.5, a2=0.5, a3=0.5)),
    "died earlier than it did": ("evidence of losses", lambda: lost(bereaved(), a3=0.8)),
    "brakes softly": ("evidence of losses", lambda: braking(0.3)),
    "brakes a little softly": ("evidence of losses", lambda: braking(0.98)),
    "brakes in a curve": ("evidence of losses", lambda: braking(1.0, turn=0.05)),
    "does not brake": ("evidence of losses", lambda: braking(0.0)),
    "the dead measures": ("coverage claimed", dead_covers),
    "a fleet torn apart, the living called dead": (
        "evidence of losses",
        lambda: claimed_anew(torn((("a1", 1.9), ("a2", 1.9)))),
    ),
    "too late": ("connectivity", lambda: torn((("a3", 4.4),))),
    "after the end": ("connectivity", lambda: torn((("a3", 99.0),))),
    "of nobody": ("connectivity", lambda: torn((("a9", 0.0),))),
    "without a time": ("connectivity", lambda: meta(torn(), lost={"a3": "early"})),
    "true": ("connectivity", lambda: meta(torn(), lost={"a3": True})),
    "never": ("connectivity", lambda: meta(torn(), lost={"a3": float("nan")})),
    "a list": ("connectivity", lambda: meta(torn(), lost=["a3"])),
    "a word": ("connectivity", lambda: meta(torn(), lost="a3")),
    "of a plan": ("connectivity", lambda: meta(torn(LOST_3), kind="plan")),
    "links of the living": ("links kept", lambda: check_by(torn((("a1", 0.0),)), linked(torn()))),
}

CLAIMS = {
    "never measured": ("coverage claimed", lambda: changed(legs(), "covered_at", np.isinf(legs().covered_at), 6.0)),
    "a sample early": ("coverage claimed", lambda: changed(flown(), "covered_at", 35, lambda t: t - 0.1)),
    "half a sample early": ("coverage claimed", lambda: changed(flown(), "covered_at", 35, lambda t: t - 0.05)),
    "all at once": ("coverage claimed", lambda: changed(flown(), "covered_at", slice(None), 0.0)),
    "before the start": ("coverage claimed", lambda: changed(flown(), "covered_at", 0, -1.0)),
    "minus infinity": ("coverage claimed", lambda: changed(flown(), "covered_at", 0, -np.inf)),
    "no number": ("coverage claimed", lambda: changed(flown(), "covered_at", 0, np.nan)),
    "of other cells": ("coverage claimed", lambda: replace(flown(), covered_at=flown().covered_at[::-1])),
    "late": ("coverage kept", lambda: changed(flown(), "covered_at", 35, lambda t: t + 0.1)),
    "not at all": ("coverage kept", lambda: changed(flown(), "covered_at", 35, np.inf)),
    "cells elsewhere": ("cells of the mission", lambda: changed(flown(), "cell", 4, lambda p: p + 0.01)),
    "cells in another order": (
        "cells of the mission",
        lambda: replace(flown(), cell=flown().cell[::-1], covered_at=flown().covered_at[::-1]),
    ),
    "fewer cells": (
        "cells of the mission",
        lambda: replace(flown(), cell=flown().cell[:-1], covered_at=flown().covered_at[:-1]),
    ),
    "a look too few": ("coverage claimed", lambda: once(flown("looks"))),
    "a look early": ("coverage claimed", lambda: changed(flown("looks"), "covered_at", 20, lambda t: t - 0.2)),
    "half of what is asked for": ("coverage claimed", lambda: once(flown("effective"))),
    "passed out of range": ("coverage claimed", lambda: wider(flown("continuous"))),
    "passed a sample early": (
        "coverage claimed",
        lambda: changed(flown("continuous"), "covered_at", flown("continuous").covered_at > 0.5, lambda t: t - 0.1),
    ),
    "older than allowed": ("age limit", lambda: check_by(flown("patrol"), limited(flown("patrol"), 2.0))),
    "in space": ("coverage claimed", lambda: wider(flown("volume"))),
}


def once(recording):
    """Return the recording with the claims of a mission that one look satisfies."""
    plain = replace(recording, mission=mission_with(recording.mission, information={"kind": "coverage"}))
    return replace(recording, covered_at=claimed_anew(plain).covered_at)


def wider(recording):
    """Return the recording with the claims of sensors that reach farther."""
    plain = replace(recording, mission=agents_with(recording.mission, sensing_radius_m=0.9))
    return replace(recording, covered_at=claimed_anew(plain).covered_at)


def limited(recording, limit_s):
    information = {"kind": "ageing", "age_limit_s": limit_s, "strict": True}
    return mission_with(recording.mission, information=information)


def free_start():
    """Return a motion from elsewhere, called a plan, whose mission says that plans start where they like."""
    there = reflown(legs("plan"), legs().input, start=legs().position[0] + [0.0, 0.3])
    return edited(there, planning={"start": "free"})


def of_the_mission(judged, recording):
    """Return a plan of there-and-back with another planning in its mission, judged by the planning that it had."""
    return check_by(recording, mission_with(recording.mission, planning=judged))


MISSIONS = {
    "a free start": ("start position", lambda: check_by(free_start(), legs().mission)),
    "another start": ("start position", lambda: check_by(legs(), agents_with(legs().mission, start_m=nudged))),
    "more speed": ("speed", lambda: check_by(flown(), agents_with(flown().mission, speed_max_m_per_s=0.6))),
    "more input": ("input", lambda: check_by(flown(), agents_with(flown().mission, input_max_m_per_s2=0.6))),
    "a wider box": (
        "box",
        lambda: check_by(
            flown(), mission_with(flown().mission, area={"motion_min_m": [0.0, 0.0], "motion_max_m": [3.0, 1.6]})
        ),
    ),
    "less separation": (
        "separation",
        lambda: check_by(bereaved(), mission_with(flown().mission, fleet={"separation_min_m": 0.75})),
    ),
    "no separation": (
        "separation",
        lambda: check_by(edited(near_flight(), fleet={"separation_min_m": 0.0}), near_flight().mission),
    ),
    "more range": ("connectivity", lambda: check_by(flown(), range_of(flown(), 1.4))),
    "no range": (
        "connectivity",
        lambda: check_by(replace(torn(), mission=range_of(torn(), 9.0)), torn().mission),
    ),
    "no links": ("links kept", lambda: check_by(torn(), linked(torn()))),
    "farther sensors": (
        "coverage claimed",
        lambda: check_by(flown(), agents_with(flown().mission, sensing_radius_m=0.5)),
    ),
    "coarser cells": ("cells of the mission", lambda: check_by(flown(), mission_with(flown().mission, area=FINER))),
    "a smaller area": ("cells of the mission", lambda: check_by(flown(), mission_with(flown().mission, area=LARGER))),
    "fewer looks": (
        "coverage claimed",
        lambda: check_by(flown(), mission_with(flown().mission, information={"kind": "looks", "looks": 3})),
    ),
    "sensors that never sleep": (
        "coverage claimed",
        lambda: check_by(claimed_anew(edited(fast(), sensing="continuous")), fast().mission),
    ),
    "longer ages": ("age limit", lambda: check_by(flown("patrol"), limited(flown("patrol"), 3.0))),
    "an end in motion": ("rest at the end", lambda: of_the_mission({"end": "rest"}, cut(legs("plan", end="free"), 6))),
    "an end anywhere": ("closed in position", lambda: of_the_mission({"end": "closed"}, cut(legs("plan"), 5))),
    "an end at any speed": ("closed in velocity", lambda: of_the_mission({"end": "closed"}, cut(legs("plan"), 11))),
}
FINER = {"cell_size_m": 0.4}
LARGER = {"shape": {"kind": "box", "min_m": [0.0, 0.0], "max_m": [3.0, 3.5]}}


def nudged(agent):
    return np.add(agent["start_m"], [0.0, 0.01]).tolist()


def fast():
    """Return a flight that passes cells in range between two samples."""
    return along([(0.94, 0.5), (1.6, 0.5), (2.3, 0.5)], leg(np.tile([0.0, 1.5], (3, 1)), 0.5, 2, 2))


def near_flight():
    return along([(0.5, 0.5), (1.2, 0.5), (1.9, 0.5)], near())


def cut(recording, samples):
    return claimed_anew(at_samples(recording, np.arange(samples)))


SEALS = {
    "another motion": lambda: reflown(written(), 0.99 * written().input),
    "a sample fewer": lambda: thinned(written()),
    "a sample more": lambda: split(written(), 2),
    "nobody lost": lambda: lost(written()),
    "another time of a loss": lambda: lost(written(), a3=written().meta["lost"]["a3"] + 0.01),
    "another seed": lambda: meta(written(), seed=7),
    "another kind": lambda: meta(written(), kind="plan"),
    "other claims": lambda: changed(written(), "covered_at", 3, lambda t: t + 1e-3),
    "another mission": lambda: edited(written(), fleet={"separation_min_m": 0.3}),
    "another digest": lambda: meta(written(), seal={**written().meta["seal"], "digest": "0" * 64}),
    "another number": lambda: meta(written(), seal={**written().meta["seal"], "samples": 3}),
    "a seal of another flight": lambda: meta(written(), seal=sealed(flown()).meta["seal"]),
    "half a seal": lambda: meta(written(), seal={"digest": written().meta["seal"]["digest"]}),
    "no seal that can be read": lambda: meta(written(), seal="unbroken"),
}
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
    "a volume": lambda: flown("volume"),
    "a fleet torn apart by a death": lambda: torn(LOST_3),
    "sealed": lambda: as_it_is_read(written()),
}
COPIES = {
    "as it is": lambda flight: flight,
    "in single precision": copied,
    "thinned": thinned,
    "thinned in single precision": lambda flight: copied(thinned(flight)),
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
