"""Transformed missions: as the originals, but elsewhere, of another size, or numbered otherwise."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mpc_cover.mission.load import build_mission
from mpc_cover.studies.mission_transforms import moved, renumbered, rotated, scaled, with_period
from mpc_cover.studies.robustness_shapes import crowds, islands, shapes
from mpc_cover.verification.area_bound import swath_bound

RAW = shapes()["hole"]


def built(raw):
    return build_mission(raw, "transformed")


@settings(max_examples=10, deadline=None)
@given(x=st.floats(-1e4, 1e4), y=st.floats(-1e4, 1e4))
def test_a_moved_mission_has_its_starts_and_cells_elsewhere(x, y):
    there, here = built(moved(RAW, (x, y))), built(RAW)
    np.testing.assert_allclose(there.fleet.start, here.fleet.start + np.array([x, y]), rtol=1e-12, atol=1e-9)
    np.testing.assert_allclose(there.field.shape_min, here.field.shape_min + np.array([x, y]), rtol=1e-12, atol=1e-9)


@pytest.mark.parametrize("factor", [1e-3, 0.1, 10.0, 1e3])
def test_a_scaled_mission_takes_the_same_time(factor):
    large, plain = built(scaled(RAW, factor)), built(RAW)
    assert large.field.size == plain.field.size
    assert swath_bound(large) == pytest.approx(swath_bound(plain))
    assert large.fleet.separation_min == pytest.approx(factor * plain.fleet.separation_min)
    assert large.spec.control == plain.spec.control


@settings(max_examples=10, deadline=None)
@given(angle=st.floats(-math.pi, math.pi))
def test_turning_keeps_distances(angle):
    turned, plain = built(rotated(RAW, angle)), built(RAW)
    apart = [np.linalg.norm(fleet.start[:, None] - fleet.start[None], axis=2) for fleet in (turned.fleet, plain.fleet)]
    np.testing.assert_allclose(*apart, atol=1e-9)


def test_renumbered_agents_keep_their_names_in_place():
    changed = built(renumbered(RAW, [2, 0, 1]))
    assert changed.fleet.ids == built(RAW).fleet.ids
    np.testing.assert_array_equal(changed.fleet.start, built(RAW).fleet.start[[2, 0, 1]])


def test_another_period_keeps_the_length_of_the_horizon():
    control = built(with_period(RAW, 0.25)).spec.control
    assert (control.period_s, control.horizon_steps) == (0.25, 40)


@pytest.mark.parametrize(
    "raw",
    [*shapes().values(), *islands().values(), *(raw for some in crowds().values() for raw in some.values())],
    ids=lambda raw: raw["name"],
)
def test_every_mission_of_the_study_is_valid(raw):
    assert built(raw).field.size > 50
