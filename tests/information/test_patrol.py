"""A patrol's laps: as late as they may be, with everything in them that cannot wait for the next."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from maps_fixtures import box_field, flight, seeing

from mpc_cover.information.patrol import PatrolMap

AWAY = np.full((3, 2), np.nan)


CELLS = np.full((3, 2), 1.0)


def after_a_lap_of(lap_s, limit_s=10.0):
    """Return a patrol of a field that one look sees, which has done a lap that took so long."""
    patrol = PatrolMap(seeing(box_field(2.0, 2.0), 3, 5.0), limit_s)
    patrol.begin_lap(0.0, AWAY)
    patrol.observe(lap_s, CELLS)
    return patrol


def left(patrol, time_s):
    return patrol.demand(time_s, AWAY).gamma[0] > 0.0


def test_what_is_unknown_is_owed_from_the_start_and_never_is_it_over():
    field = box_field(2.0, 2.0)
    patrol = PatrolMap(seeing(field, 3, 5.0), 10.0)
    assert patrol.owed.all()
    patrol.begin_lap(0.0, AWAY)
    assert left(patrol, 0.0).all()
    assert patrol.overdue.all()
    patrol.observe(1.0, CELLS)
    assert not patrol.overdue.any()
    assert patrol.owed.all()
    assert patrol.fraction == 1.0
    assert not patrol.complete
    assert not left(patrol, 1.0).any()
    np.testing.assert_array_equal(patrol.covered_at, 1.0)


def test_a_lap_begins_when_it_must():
    patrol = after_a_lap_of(4.0)  # too old at 14 s
    for time_s, due in ((5.0, False), (9.9, False), (10.1, True), (14.0, True)):
        patrol.begin_lap(time_s, AWAY)
        assert left(patrol, time_s).any() == due


@settings(max_examples=30)
@given(seed=st.integers(0, 10**6), lap=st.floats(0.0, 8.0))
def test_who_does_its_laps_in_time_lets_nothing_get_too_old(seed, lap):
    """Right after a lap is done, no next one has to begin before another lap's time is over."""
    rng = np.random.default_rng(seed)
    field, limit = box_field(), 9.0
    patrol = PatrolMap(seeing(field), limit)
    patrol.begin_lap(0.0, AWAY)
    patrol.restore({**patrol.state(), "clock": np.array([0.0, 0.0, lap])})
    for n, position in enumerate(flight(rng, field, steps=20)):
        patrol.observe(0.5 * n, position)
    now = 10.0
    patrol.begin_lap(now, AWAY)
    asked = left(patrol, now)
    spare = patrol.ages.last[0] + limit - now
    unknown = np.isinf(patrol.first[0])
    must = unknown.any() or spare.min() < lap
    assert asked.any() == must
    if must:
        assert (asked >= unknown).all()
        assert (spare[~asked] >= 2.0 * lap).all()
        gamma = patrol.demand(now, AWAY).gamma[0]
        assert gamma.max() == 1.0
        assert gamma[asked].min() >= 0.25


@settings(max_examples=20)
@given(seed=st.integers(0, 10**6))
def test_a_lap_is_done_where_it_was_looked_at_since(seed):
    rng = np.random.default_rng(seed)
    field = box_field()
    patrol = PatrolMap(seeing(field), 3.0, growth_per_s=2.0)
    patrol.begin_lap(0.0, AWAY)
    path = flight(rng, field, steps=10)
    seen = np.zeros(field.size, dtype=bool)
    for n, position in enumerate(path):
        patrol.observe(0.5 * n, position)
        seen[seeing(field).looks(0.0, position).place] = True
        np.testing.assert_array_equal(left(patrol, 0.5 * n), ~seen)
    patrol.observe(20.0, AWAY)
    np.testing.assert_allclose(patrol.residual, 2.0 * np.maximum(patrol.ages.age - 3.0, 0.0))
    assert patrol.overdue.all()
    assert patrol.covered_count == 0


def test_what_the_fleet_will_see_at_once_is_no_part_of_a_lap_and_ends_the_last():
    patrol = PatrolMap(seeing(box_field(2.0, 2.0), 3, 5.0), 10.0)
    patrol.begin_lap(0.0, AWAY)
    patrol.begin_lap(4.0, CELLS)  # planned from where the first lap ends, a little later
    assert not left(patrol, 4.0).any()
    patrol.observe(4.0, CELLS)
    patrol.begin_lap(9.9, AWAY)
    assert not left(patrol, 9.9).any()
    patrol.begin_lap(10.1, AWAY)  # laps take 4 s, and all is too old at 14 s
    assert left(patrol, 10.1).all()
