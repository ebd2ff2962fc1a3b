"""Claims of coverage that are not so, missions edited along with the motion, and broken seals, likewise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from planted_flights import (
    agents_with,
    bereaved,
    claimed_anew,
    edited,
    flown,
    leg,
    legs,
    mission_with,
    reflown,
    split,
    thinned,
    torn,
    written,
)
from planting import along, changed, check_by, cut, linked, lost, meta, near, range_of

from mpc_cover.record_seal import sealed


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


def nudged(agent):
    return np.add(agent["start_m"], [0.0, 0.01]).tolist()


def fast():
    """Return a flight that passes cells in range between two samples."""
    return along([(0.94, 0.5), (1.6, 0.5), (2.3, 0.5)], leg(np.tile([0.0, 1.5], (3, 1)), 0.5, 2, 2))


def near_flight():
    return along([(0.5, 0.5), (1.2, 0.5), (1.9, 0.5)], near())


FINER = {"cell_size_m": 0.4}


LARGER = {"shape": {"kind": "box", "min_m": [0.0, 0.0], "max_m": [3.0, 3.5]}}


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
    "a number that is none": lambda: meta(written(), seal={**written().meta["seal"], "samples": float("inf")}),
    "no seal that can be read": lambda: meta(written(), seal="unbroken"),
}
