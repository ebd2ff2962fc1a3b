"""The planner as the controller sees it."""

from __future__ import annotations

import pytest

from mpc_cover.errors import UserError
from mpc_cover.planning.planner import Planner


def test_an_unknown_back_end_is_a_clear_error():
    with pytest.raises(UserError, match="clarabel"):
        Planner("gurobi")
