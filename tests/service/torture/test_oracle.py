"""The oracle, on motions of which the truth is known."""

import numpy as np
import pytest
from service_fakes import small_mission

from mpc_cover.service.agent.recorder import Piece
from mpc_cover.service.torture.oracle import judge

MISSION = small_mission()


def straight(start, velocity, end_s=6.0):
    """Return the record of an agent that flies at constant velocity from its start."""
    end = (np.array(start) + end_s * np.array(velocity)).tolist()
    return [Piece(0.0, list(start), list(velocity), [0.0, 0.0]), Piece(end_s, end, list(velocity), [0.0, 0.0])]


def seen(first, second, *, apart=(), claimed=None, end_s=6.0):
    """Return what the oracle says of two agents' records."""
    return judge(MISSION, {"a1": first, "a2": second}, end_s, apart=apart, claimed=claimed)


def kinds(sight):
    return {violation.what for violation in sight.violations}


def test_agents_that_keep_apart_violate_nothing():
    sight = seen(straight((0.5, 0.5), (0.0, 0.3)), straight((2.5, 0.5), (0.0, 0.3)))
    assert not sight.violations
    assert sight.smallest_m == pytest.approx(2.0)


def test_paths_that_cross_between_samples_are_seen_and_how_near():
    sight = seen(straight((0.0, 1.0), (0.5, 0.0)), straight((3.0, 1.1), (-0.5, 0.0)))
    assert kinds(sight) == {"separation"}
    assert sight.smallest_m == pytest.approx(0.1, abs=1e-6)
    assert sight.violations[0].agents == ("a1", "a2")
    assert sight.violations[0].time_s == pytest.approx(3.0 - np.sqrt(0.5**2 - 0.1**2), abs=0.02)


def test_separation_holds_while_links_are_down_too_and_range_does_not():
    away = straight((0.0, 0.0), (0.0, 0.0)), straight((2.5, 0.0), (0.0, 0.6))
    assert kinds(seen(*away)) == {"connectivity"}
    assert not kinds(seen(*away, apart=[(0.0, 9.0)]))
    assert kinds(seen(*away, apart=[(0.0, 5.0)])) == {"connectivity"}
    near = straight((0.0, 1.0), (0.5, 0.0)), straight((3.0, 1.1), (-0.5, 0.0))
    assert kinds(seen(*near, apart=[(0.0, 9.0)])) == {"separation"}


@pytest.mark.parametrize(
    ("what", "record"),
    [
        ("speed", straight((0.5, 0.2), (0.0, 1.1), 2.0)),
        ("box", straight((0.5, 0.2), (-0.2, 0.0))),
        ("input", [Piece(0.0, [0.5, 0.5], [0.0, 0.0], [0.0, 1.2]), Piece(0.5, [0.5, 0.65], [0.0, 0.6], [0.0, -0.6])]),
        ("jump", [Piece(0.0, [0.5, 0.5], [0.0, 0.0], [0.0, 0.0]), Piece(2.0, [0.5, 0.6], [0.0, 0.0], [0.0, 0.0])]),
    ],
)
def test_limits_box_and_unbroken_motion_hold(what, record):
    assert kinds(seen(record, straight((2.2, 0.5), (0.0, 0.0)), end_s=record[-1].time_s)) == {what}


def test_cells_that_nobody_came_near_to_are_no_claim():
    still = straight((0.5, 0.5), (0.0, 0.0)), straight((2.5, 0.5), (0.0, 0.0))
    cells = MISSION.field.cell
    truly = (np.linalg.norm(cells[:, None] - [[0.5, 0.5], [2.5, 0.5]], axis=-1) <= 1.0).any(axis=1)
    assert not kinds(seen(*still, claimed=truly))
    assert kinds(seen(*still, claimed=np.ones(len(cells), dtype=bool))) == {"claim"}
