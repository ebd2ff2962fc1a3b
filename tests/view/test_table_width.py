"""Every table that a command prints is whole at 80 columns, whatever it holds."""

from __future__ import annotations

import io
import re
from dataclasses import replace

import msgspec
import numpy as np
import pytest
from flights import box3_flight
from rich.console import Console

from mpc_cover.control.controller_name import ControllerName
from mpc_cover.studies.laws import LawRun, print_table
from mpc_cover.studies.record import Record
from mpc_cover.studies.robustness_cases import cases
from mpc_cover.studies.robustness_report import print_tables
from mpc_cover.studies.robustness_result import RobustnessResult
from mpc_cover.studies.study_table import print_groups
from mpc_cover.studies.tally import group
from mpc_cover.verification.check import check_trajectory
from mpc_cover.verification.report import Check, CheckName, Report
from mpc_cover.verification.summary import summarise
from mpc_cover.view.benchmark import Row, print_benchmark, print_maps, print_steps
from mpc_cover.view.tables import print_report, print_summary

TERMINAL = 80
SLOW = Row(
    "ours-clarabel", 12.25, 3600.25, 99_999.9, 20_923.1234, 100.0, 3599.99, 20_923.1234,
    3e-05, 3e-05, -10.123, -10.123, 123_456, "stopped: it did not heed the time limit",
    "separation -0.25 m (a1 - a2, t = 123.500 s)", holds=False,
)  # fmt: skip
NAMES = ("ours-clarabel", "ipopt-hessian", "slsqp-min", "sqpmethod")


def benchmark(console):
    print_benchmark([replace(SLOW, name=name) for name in NAMES], "field-40 from rest " + 20 * "long ", console)


def steps(console):
    parts = dict.fromkeys(("nearest samples", "verification", "the rest", "step"), (12345.67, 123456.78, 1.0))
    print_steps(parts, "box-3-windy, clarabel: one control step", console)


def maps(console):
    row = {"map": "Kalman, drawing its readings", "cells_in_range": 3126, "p50_ms": 12_345.67, "p99_ms": 123_456.78}
    print_maps([row], "100489 cells, 50 agents: a step of the map, its gamma included; processor time", console)


def summary(console):
    flight = box3_flight()
    found = summarise(flight, check_trajectory(flight), np.array([0.02, 0.03]))
    far = {f"a{i}": 1234.5 for i in range(64)}
    print_summary(replace(found, distance_m=far, connected=False, bottleneck_m=1234.567), console)


def report(console):
    where = "agent-with-a-long-name-1 - agent-with-a-long-name-2, t = 1234.500 s"
    print_report(Report(tuple(Check(name, False, -12_345.6789, "m/s^2", where) for name in CheckName)), console)


def robustness(console):
    rows = [RobustnessResult(case, record(complete=False, time_to_99_s=None), 7.0) for case in cases()]
    print_tables(rows, console)


def horizons(console):
    bad = {"error": "RuntimeError: no", "violations": 12, "separation_margin_m": -12.345, "time_to_99_s": 1234.5}
    timed = {"swath_bound_s": 10.0, "ratio_99": 123.45, "step_ms": (123_456.7,), "misses": 123, "horizon_s": 12.5}
    runs = [
        record(key=f"{backend} {starts}", backend=backend, starts=starts, period_s=period, **bad, **timed)
        for backend in ("piqp", "clarabel")
        for starts, period in (("random", 0.25), ("mission", 0.5))
    ]
    print_groups(group(runs), console)


def laws(console):
    numbers = {each.name: 123_456 for each in msgspec.structs.fields(LawRun)}
    runs = [LawRun(**{**numbers, "mission": "m", "law": law}) for law in (ControllerName.MPC, ControllerName.POTENTIAL)]
    print_table("fig-6-2-double", runs, console)


def record(**changes):
    given = {"key": "k", "mission": "box-3-windy", "controller": "mpc", "backend": "piqp", "horizon_steps": 8}
    return Record(
        **{**given, "horizon_s": 4.0, "period_s": 0.5, "seed": 0, "starts": "random", "versions": {}, **changes}
    )


TABLES = [benchmark, steps, maps, summary, report, robustness, horizons, laws]


def printed(show, width):
    console = Console(file=io.StringIO(), width=width, color_system=None)
    show(console)
    return console.file.getvalue()


def words(text):
    return sorted(re.sub(r"[│┃━┏┓┗┛┡┩┳┻╇╈─┌┐└┘├┤┬┴┼]", " ", text).split())


@pytest.mark.parametrize("show", TABLES, ids=lambda show: show.__name__)
def test_a_table_is_whole_at_80_columns(show):
    narrow = printed(show, TERMINAL)
    assert "…" not in narrow
    assert max(len(line.rstrip()) for line in narrow.splitlines()) <= TERMINAL
    assert words(narrow) == words(printed(show, 400)), "words are broken"
