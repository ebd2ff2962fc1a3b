"""Medians and the worst of runs that differ by their seed."""

import math

import pytest
from study_fixtures import never, record_of, tiny_run

from mpc_cover.studies.tally import group, median, worst


def groups_of(*records):
    return group(records)["tiny"]


def test_runs_are_grouped_by_all_but_the_seed_and_by_horizon_first():
    runs = [
        tiny_run("sweep"),
        tiny_run(horizon_steps=24),
        *(tiny_run(seed=seed) for seed in (1, 0)),
        tiny_run(name="other"),
    ]
    found = group([record_of(run) for run in runs])
    assert list(found) == ["other", "tiny"]
    assert [(one.label, len(one.records)) for one in found["tiny"]] == [("mpc 4 s", 2), ("mpc 12 s", 1), ("sweep", 1)]


def test_labels_say_what_differs():
    runs = [
        tiny_run(),
        tiny_run(backend="osqp"),
        tiny_run(period_s=0.25, horizon_steps=16),
        tiny_run("sweep", starts="mission"),
    ]
    assert [one.label for one in groups_of(*map(record_of, runs))] == [
        "mpc 4 s native T 0.25 s random start",
        "mpc 4 s native T 0.5 s random start",
        "mpc 4 s osqp T 0.5 s random start",
        "sweep T 0.5 s mission start",
    ]


def test_medians_and_the_worst():
    (one,) = groups_of(*(record_of(tiny_run(seed=seed), violations=seed, misses=1) for seed in range(3)))
    assert median(one.time_99_s) == pytest.approx(10.1)
    assert worst(one.ratio_99) == pytest.approx(10.2 / 8.0)
    assert (one.complete_percent, one.errors, one.violations, one.violators, one.misses) == (100.0, 0, 3, 2, 3)
    assert one.margin_m == 0.1
    assert one.step_ms.size == 9
    assert one.to_dict()["worst_time_to_99_s"] == pytest.approx(10.2)


def test_never_is_longer_than_any():
    (one,) = groups_of(record_of(tiny_run()), never(tiny_run(seed=1)), record_of(tiny_run(seed=2)))
    assert one.complete_percent == 66.66
    assert median(one.time_99_s) == pytest.approx(10.2)
    assert math.isinf(worst(one.time_99_s))
    assert one.to_dict()["worst_ratio_99"] is None


def test_all_that_may_be_missing_is():
    bare = {"swath_bound_s": None, "ratio_99": None, "separation_margin_m": None, "violations": None, "step_ms": ()}
    (one,) = groups_of(never(tiny_run(), error="KilledWorker: lost", **bare))
    data = one.to_dict()
    assert data["errors"] == 1
    for name in ("median_ratio_99", "worst_separation_margin_m", "step_p99_ms", "median_time_to_99_s"):
        assert data[name] is None
