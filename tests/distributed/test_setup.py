"""Missions that agents by themselves cannot fly are refused in words."""

from __future__ import annotations

import pytest
from mission_kinds import KINDS, mission_with

from mpc_cover.distributed.setup import make_agent
from mpc_cover.errors import UserError


def test_a_patrol_is_refused_in_words():
    with pytest.raises(UserError, match=r"information.kind ageing: .*\(--controller mpc\)"):
        make_agent(mission_with(KINDS["ageing"]), 0, seed=0)


def test_more_readings_than_words_can_carry_are_refused_in_words():
    with pytest.raises(UserError, match=r"information.kind kalman: .* at most \d+: make area.cell_size_m \(now 0.02\)"):
        make_agent(mission_with(KINDS["kalman"], cell_size=0.02), 0, seed=0)
