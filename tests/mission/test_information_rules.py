"""What missions may ask of their information, and what they are told when they may not."""

from __future__ import annotations

import pytest
from mission_files import changed, mistakes
from mission_kinds import KINDS, mission_with

from mpc_cover.mission.load import build_mission, mission_from_json

EFFECTIVE = {"kind": "effective", "level": 2.0}
KALMAN = KINDS["kalman"]


@pytest.mark.parametrize(
    ("changes", "where", "right"),
    [
        ([("information", {"kind": "magic"})], "information", "must be of the kind 'coverage', 'looks'"),
        ([("information", {})], "information", "coverage, looks, effective, kalman or ageing"),
        ([("information", 3)], "information", "must be"),
        ([("information", {"kind": "looks"})], "information.looks", "is missing"),
        ([("information", {"kind": "looks", "looks": 0})], "information.looks", "greater than or equal to 1"),
        ([("information", {"kind": "looks", "looks": True})], "information.looks", "not true or false"),
        ([("information", {"kind": "looks", "looks": 3}), ("area.looks", 2)], "information.looks", "contradicts area"),
        ([("information", EFFECTIVE), ("area.looks", 2)], "area.looks", "information of kind effective says itself"),
        ([("information", KALMAN), ("area.looks", 2)], "area.looks", "of kind kalman"),
        ([("information", KINDS["ageing"]), ("area.looks", 2)], "area.looks", "of kind ageing"),
        ([("information", {**EFFECTIVE, "level": 0})], "information.level", "greater than 0"),
        ([("information", {**EFFECTIVE, "level": 11})], "information.level", "needs up to 110 looks"),
        ([("information", {**EFFECTIVE, "rim": 2})], "information.rim", "at most peak 1"),
        ([("information", {**EFFECTIVE, "function": "step"})], "information.function", "'constant' or 'bump'"),
        ([("information", {**EFFECTIVE, "function": "constant", "rim": 0.2})], "information.rim", "left out"),
        ([("information", {**KALMAN, "target_variance": 4.0})], "information.target_variance", "less than prior_var"),
        ([("information", {**KALMAN, "target_variance": 1e-3})], "information.target_variance", "needs 1000 looks"),
        ([("information", {**KALMAN, "noise_variance": -1})], "information.noise_variance", "greater than 0"),
        ([("information", {**KALMAN, "field": {"seed": -1}})], "information.field.seed", "greater than or equal"),
        ([("information", {**KALMAN, "colour": 1})], "information.colour", "is not a known key"),
        ([("information", {"kind": "ageing", "age_limit_s": 0.1})], "information.age_limit_s", "at least period_s"),
        ([("information", {"kind": "ageing"})], "information.age_limit_s", "is missing"),
    ],
)  # fmt: skip
def test_a_mistake_is_named_with_what_would_be_right(changes, where, right):
    found = mistakes(changed(*changes))
    assert where in found, found
    assert right in found[where]


@pytest.mark.parametrize("kind", KINDS)
def test_a_mission_is_read_back_as_it_was(kind):
    mission = mission_with(KINDS[kind])
    again = mission_from_json(mission.to_json(), "again")
    assert again.spec == mission.spec
    assert again.spec.information.kind == kind


def test_who_asks_for_nothing_special_says_nothing_about_it():
    assert "information" not in mission_with(None).to_json()
    assert not mission_with(None).spec.looks_again


def test_looks_may_be_said_in_either_place_or_both():
    both = build_mission(changed(("information", {"kind": "looks", "looks": 3}), ("area.looks", 3)), "both")
    one = build_mission(changed(("area.looks", 3)), "one")
    assert both.spec.looks == one.spec.looks == 3
    assert mission_with({"kind": "looks", "looks": 3}).spec.looks == 3
    assert one.spec.looks_again
