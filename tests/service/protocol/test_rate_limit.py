"""An allowance for each author."""

from hypothesis import given
from hypothesis import strategies as st

from mpc_cover.service.protocol.rate_limit import BURST, PER_S, RateLimit

GAPS = st.lists(st.floats(0.0, 2.0), min_size=1, max_size=200)


@given(GAPS)
def test_never_more_than_the_burst_and_what_has_grown_since(gaps):
    limit, now, allowed = RateLimit(burst=5, per_s=3.0), 100.0, 0
    for gap in gaps:
        now += gap
        allowed += limit.allows("a1", now)
        assert allowed <= 5 + 3.0 * (now - 100.0) + 1e-6


@given(GAPS)
def test_who_keeps_to_it_is_always_heard_whatever_others_do(gaps):
    limit, now = RateLimit(burst=5, per_s=3.0), 100.0
    for gap in gaps:
        now += 0.34 + gap
        for _ in range(20):
            limit.allows("flood", now)
        assert limit.allows("a1", now)


def test_a_clock_that_stands_still_or_goes_back_gives_nothing():
    limit = RateLimit(burst=2, per_s=100.0)
    assert [limit.allows("a1", now) for now in (5.0, 5.0, 5.0, 4.0)] == [True, True, False, False]


def test_a_history_of_600_states_and_the_reports_of_20_hz_are_within_it():
    limit = RateLimit()
    assert all(limit.allows("a1", 0.0) for _ in range(600))
    assert all(limit.allows("a1", step / 20.0) for step in range(1200))
    assert (BURST, PER_S) == (1024, 200.0)
