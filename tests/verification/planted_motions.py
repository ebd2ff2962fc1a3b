"""Motions that nobody may fly, and losses that are none, each with the check that is meant to find it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from planted_flights import agents_with, bereaved, claimed_anew, copied, flown, leg, legs, reflown, split, torn
from planting import along, at_samples, changed, check_by, linked, lost, meta, near, range_of

LOST_3 = (("a3", 2.0),)


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


def dip():
    """Return inputs that swing the first below the edge of its box within a period, and above it at the samples."""
    force = np.zeros((6, 3, 2))
    force[:3, 0, 1] = -0.4, 0.8, -0.4
    return force


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
    "too long ago for a number": ("connectivity", lambda: meta(torn(), lost={"a3": -(10**400)})),
    "a list": ("connectivity", lambda: meta(torn(), lost=["a3"])),
    "a word": ("connectivity", lambda: meta(torn(), lost="a3")),
    "of a plan": ("connectivity", lambda: meta(torn(LOST_3), kind="plan")),
    "links of the living": ("links kept", lambda: check_by(torn((("a1", 0.0),)), linked(torn()))),
}
