"""gamma grows again outside the range, by the clock, and a patrol keeps it small."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from maps_fixtures import box_field, flight, seeing

from mpc_cover.information.ageing import AgeingMap


@settings(max_examples=30)
@given(seed=st.integers(0, 10**6))
def test_the_age_is_the_time_since_the_last_look(seed):
    rng = np.random.default_rng(seed)
    field = box_field()
    information = AgeingMap(seeing(field), fresh_s=2.0)
    last = np.zeros((1, field.size))
    for n, position in enumerate(flight(rng, field)):
        now = 0.5 * n
        information.observe(now, position)
        last.reshape(-1)[seeing(field).looks(now, position).place] = now
        np.testing.assert_allclose(information.age, now - last)
        np.testing.assert_allclose(information.residual, np.maximum(now - last - 2.0, 0.0))
        assert (information.owed == (information.residual > 0.0)).all()
        assert information.complete == (information.fraction == 1.0)
        assert information.worst_age == information.age.max()
        assert information.mean_age == pytest.approx(information.age.mean())


def test_what_nobody_sees_is_owed_again():
    field = box_field(1.0, 1.0)
    information = AgeingMap(seeing(field, 1, 5.0), fresh_s=3.0)
    away = np.array([[np.nan, np.nan]])
    for second in range(1, 4):
        information.observe(float(second), away)
        assert information.complete
    information.observe(4.0, away)
    assert not information.complete
    assert (information.residual == 1.0).all()
    information.observe(5.0, np.array([[0.5, 0.5]]))
    assert information.complete
    assert information.worst_age == 0.0


def test_late_news_make_nothing_older():
    field = box_field(1.0, 1.0)
    sight = seeing(field, 1, 5.0)
    information = AgeingMap(sight, fresh_s=0.0)
    information.observe(4.0, np.array([[0.5, 0.5]]))
    information.take(sight.looks(2.0, np.array([[0.5, 0.5]])))
    information.pass_time(3.0)
    assert information.worst_age == 0.0
    assert information.now_s == 4.0


@pytest.mark.parametrize("fresh", [-1.0, np.inf, np.nan])
def test_fresh_must_be_a_time(fresh):
    with pytest.raises(ValueError, match="fresh_s"):
        AgeingMap(seeing(box_field()), fresh_s=fresh)
