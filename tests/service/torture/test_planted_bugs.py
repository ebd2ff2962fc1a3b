"""Planted safety bugs are caught: a handful always, all of them by `pytest -m slow`."""

import pytest
from planted_bugs import BUGS, UNCAUGHT_MOST, caught

QUICK = (
    "plans_do_not_end_at_rest",
    "a_restarted_agent_thinks_to_be_at_the_missions_start",
    "what_is_planned_counts_as_measured",
    "sensing_radii_are_taken_for_larger",
)
"""Caught by the first seeds."""


@pytest.mark.parametrize("name", QUICK)
def test_a_planted_bug_is_caught_by_a_few_seeds(name):
    assert caught(name, seeds=3) is not None


@pytest.mark.slow
def test_nearly_all_planted_bugs_are_caught():
    missed = [name for name in BUGS if caught(name) is None]
    assert len(missed) <= UNCAUGHT_MOST, missed
