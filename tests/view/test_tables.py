"""What the terminal says of a run."""

from __future__ import annotations

import io
from dataclasses import replace

import numpy as np
import pytest
from flights import box3_flight
from rich.console import Console

from mpc_cover.verification.check import check_trajectory
from mpc_cover.verification.report import Check, Report
from mpc_cover.verification.summary import summarise
from mpc_cover.view.tables import print_report, print_summary


@pytest.fixture(scope="module")
def flight():
    return box3_flight()


def printed(show, value):
    console = Console(file=io.StringIO(), width=120, color_system=None)
    show(value, console)
    return console.file.getvalue()


def test_summary_of_a_good_run(flight):
    text = printed(print_summary, summarise(flight, check_trajectory(flight), np.array([0.02, 0.03])))
    assert "98.50 % (394 of 400 cells)" in text
    assert "21.0 s / 21.5 s / never / never" in text
    assert "1.295 m (at least 0.5 m asked for)" in text
    assert "yes (longest tree edge 2.237 m of 5.5 m)" in text
    assert "1.334 of 1.5 m/s" in text
    assert "25.0 / 29.9 / 30.0 ms of 500 ms" in text
    assert "0 of 2" in text
    assert "violation" not in text


def test_almost_everything_is_not_everything(flight):
    summary = summarise(flight, check_trajectory(flight))
    almost = replace(summary, cells=100_000, covered_cells=99_999, covered_percent=99.99)
    assert "100.00 %" not in printed(print_summary, almost)


def test_distances_and_speeds_are_rounded_against_the_run(flight):
    summary = summarise(flight, check_trajectory(flight))
    close = replace(
        summary,
        smallest_separation_m=0.4999,
        connected=False,
        bottleneck_m=5.5001,
        largest_speed_m_per_s=1.5001,
        largest_input_m_per_s2=1.5 + 1e-7,
    )
    text = printed(print_summary, close)
    assert "0.499 m" in text
    assert "NO (longest tree edge 5.501 m of 5.5 m)" in text
    assert "1.501 of 1.5 m/s" in text
    assert "1.500 of 1.5 m/s^2" in text


def test_summary_lists_violations_and_leaves_out_what_does_not_apply(flight):
    summary = summarise(flight, check_trajectory(flight))
    bad = replace(
        summary,
        holds=False,
        violations=("speed: FAILS, margin -1 m/s (a1 [x], t = 1.000 s)",),
        swath_bound_s=None,
        smallest_separation_m=None,
        bottleneck_m=None,
    )
    text = printed(print_summary, bad)
    assert "violation: speed: FAILS, margin -1 m/s (a1 [x], t = 1.000 s)" in text
    assert "swath" not in text
    assert "separation" not in text
    assert "connected" not in text


def test_connectivity_that_was_not_asked_for(flight):
    summary = replace(summarise(flight, check_trajectory(flight)), connected=None)
    assert "not asked for (longest tree edge 2.237 m)" in printed(print_summary, summary)


def test_report_of_a_good_run(flight):
    text = printed(print_report, check_trajectory(flight))
    assert "all 15 checks hold" in text
    assert "+0.1667 m/s" in text
    assert "a1 - a2, t = 2.242 s" in text


def test_report_of_a_bad_one():
    checks = (
        Check("speed", False, -2e-6, "m/s", "a1, t = 1.000 s"),
        Check("numbers", False, -np.inf, "", "not looked at"),
        Check("box", True, 1.0, "m", "a2"),
    )
    text = printed(print_report, Report(checks))
    assert "2 of 3 checks failed" in text
    assert "-2.0e-06 m/s" in text
    assert "inf" not in text
