"""Tests of the order in which a free-horizon search tries lengths."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mpc_cover.planning.length_bracket import LengthBracket


def tried(first: int, assumed: int, truth: int, least: int = 2) -> tuple[list[int], LengthBracket]:
    """Return the lengths that are tried, and the last bracket, where all of at least `truth` steps suffice."""
    bracket, steps, lengths = LengthBracket(assumed, least), first, [first]
    while True:
        bracket = bracket.after(steps, complete=steps >= truth)
        following = bracket.following(steps, 0.1)
        if following is None:
            return lengths, bracket
        steps = following
        lengths.append(steps)


@given(guess=st.integers(4, 400), part=st.floats(0.1, 2.0), least=st.integers(2, 4), share=st.sampled_from((0.76, 1.0)))
def test_the_shortest_sufficient_length_is_found_wherever_it_is(
    guess: int, part: float, least: int, share: float
) -> None:
    """Also where it is far below what the guess lets expect; and no length is tried twice."""
    truth = max(least, round(part * guess))
    lengths, bracket = tried(max(least, round(0.92 * guess)), round(share * guess), truth, least)
    assert bracket.shortest == truth
    assert len(set(lengths)) == len(lengths)
    assert min(lengths) >= least


def test_no_more_is_tried_than_before_where_the_guess_is_a_good_estimate() -> None:
    assert tried(32, 27, 29)[0] == [32, 29, 28]


def test_strides_downward_double_up_to_a_part_of_the_length() -> None:
    lengths, _ = tried(23, 19, 10)
    assert lengths[:6] == [23, 21, 20, 19, 17, 13]
    assert len(tried(370, 300, 40)[0]) < 25


@pytest.mark.parametrize("left", [0.0, 0.1, 1.0])
def test_failures_before_the_first_success_lengthen_by_what_is_left(left: float) -> None:
    bracket = LengthBracket(10, 2).after(20, complete=False)
    following = bracket.following(20, left)
    assert following is not None
    assert 22 <= following <= 26
