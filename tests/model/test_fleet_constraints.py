"""What follows from a fleet's fields: worked out once, never stale, and nobody can write to it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from flights import fleet_of


def fleet(**changes):
    return fleet_of(np.arange(8.0).reshape(4, 2), separation_min=0.5, **changes)


def test_nothing_is_asked_of_two_who_are_lost_and_what_can_be_kept_of_two_who_are_too_near():
    some = fleet(lost=(1, 3), pair_separation={(0, 2): 0.3, (1, 3): 0.2})
    # pairs 01, 02, 03, 12, 13, 23
    assert some.separations.tolist() == [0.5, 0.3, 0.5, 0.5, 0.0, 0.5]


@pytest.mark.parametrize("lost", [(), (2,), (0, 3), (0, 1, 2, 3)])
def test_those_who_take_part_are_all_but_the_lost(lost):
    some = fleet(lost=lost)
    assert set(some.active) | set(lost) == set(range(4))
    assert not set(some.active) & set(lost)
    assert np.flatnonzero(some.is_active).tolist() == list(some.active)


def test_a_fleet_with_other_fields_has_its_own():
    one = fleet(lost=(1,))
    assert one.active == (0, 2, 3)
    assert one.separations[0] == 0.5
    other = replace(one, lost=(0, 1), separation_min=0.7)
    assert other.active == (2, 3)
    assert other.is_active.tolist() == [False, False, True, True]
    assert other.separations.tolist() == [0.0, 0.7, 0.7, 0.7, 0.7, 0.7]


@pytest.mark.parametrize("name", ["separations", "is_active"])
def test_what_is_worked_out_once_is_read_only(name):
    some = fleet(lost=(1,))
    assert getattr(some, name) is getattr(some, name)
    with pytest.raises(ValueError, match="read-only"):
        getattr(some, name)[0] = 0
