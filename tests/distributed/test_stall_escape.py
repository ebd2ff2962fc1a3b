"""The way out of a tug-of-war."""

from __future__ import annotations

import numpy as np

from mpc_cover.distributed.stall_escape import StallEscape

CELL = np.array([[0.0, 0.0], [4.0, 0.0], [0.0, 4.0]])


def test_a_stalled_agent_attends_to_the_first_cell_owed_in_the_common_order():
    order = np.array([2, 0, 1])
    escape = StallEscape(order, 3)
    weight = np.array([1.0, 1.0, 0.0])
    for _ in range(3):
        assert (escape.attend(weight) == weight).all()
        assert not escape.stalled
    assert escape.attend(weight).tolist() == [1.0, 0.0, 0.0]
    assert escape.stalled
    better = np.array([1.0, 0.5, 0.0])
    assert (escape.attend(better) == better).all()
    assert not escape.stalled


def test_a_stalled_agent_with_nothing_owed_stays_put():
    escape = StallEscape(np.arange(2), 1)
    escape.attend(np.zeros(2))
    assert (escape.attend(np.zeros(2)) == 0.0).all()
