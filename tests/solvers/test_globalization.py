"""The trust region's size and the line search's lengths."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from solvers.globalization import Backtracking, TrustRegion

REGION = TrustRegion(1.0, smallest=1e-3, largest=8.0)


@pytest.mark.parametrize(
    ("ratio", "step", "radius"),
    [(0.1, 1.0, 0.25), (0.5, 1.0, 1.0), (0.9, 1.0, 2.0), (0.9, 0.1, 1.0), (-1.0, 1.0, 0.25)],
)
def test_after_an_accepted_step(ratio: float, step: float, radius: float) -> None:
    assert REGION.accepted(ratio, step).radius == radius


@pytest.mark.parametrize(("step", "radius"), [(1.0, 0.25), (0.4, 0.1), (9.0, 0.25), (0.0, 1e-3)])
def test_after_a_rejected_step(step: float, radius: float) -> None:
    assert REGION.rejected(step).radius == pytest.approx(radius)


@given(st.lists(st.tuples(st.booleans(), st.floats(-2, 2), st.floats(0, 10)), max_size=30))
def test_radius_stays_within_its_bounds(events: list[tuple[bool, float, float]]) -> None:
    region = REGION
    for taken, ratio, step in events:
        region = region.accepted(ratio, step) if taken else region.rejected(step)
        assert region.smallest <= region.radius <= region.largest


def test_exhausted() -> None:
    region = REGION
    for _ in range(20):
        assert not region.exhausted or region.radius == region.smallest
        region = region.rejected(region.radius)
    assert region.exhausted


@pytest.mark.parametrize(
    "bad",
    [
        {"radius": 0.0},
        {"radius": float("nan")},
        {"radius": 2e3},
        {"radius": 1.0, "smallest": 0.0},
        {"radius": 1.0, "smallest": 5.0, "largest": 2.0},
        {"radius": 1.0, "shrink": 1.0},
        {"radius": 1.0, "grow": 1.0},
        {"radius": 1.0, "poor": 0.8},
    ],
)
def test_regions_that_cannot_work(bad: dict[str, float]) -> None:
    with pytest.raises(ValueError, match="got"):
        TrustRegion(**bad)


def test_first_sufficient_length() -> None:
    tried = []

    def decrease(length: float) -> float:
        tried.append(length)
        return 1.0 if length <= 0.25 else -1.0

    assert Backtracking().search(lambda length: length, decrease, 1.0) == (0.25, 0.25)
    assert tried == [0.5, 0.25]


def test_sufficient_is_relative_to_the_length() -> None:
    search = Backtracking(most=3, sufficient=0.5)
    assert search.search(lambda length: length, lambda length: 0.5 * length, 1.0) == (0.5, 0.5)
    assert search.search(lambda length: length, lambda length: 0.49 * length, 1.0) is None


def test_no_trials() -> None:
    assert Backtracking(most=0).search(lambda length: length, lambda _length: 1.0, 1.0) is None


@pytest.mark.parametrize("bad", [{"most": -1}, {"factor": 1.0}, {"factor": 0.0}, {"sufficient": 0.0}])
def test_searches_that_would_not_end(bad: dict[str, float]) -> None:
    with pytest.raises(ValueError, match="got"):
        Backtracking(**bad)  # type: ignore[arg-type]
