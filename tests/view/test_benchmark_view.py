"""The benchmark's table and its curves."""

from __future__ import annotations

import io
from dataclasses import replace

import numpy as np
import pytest
from rich.console import Console

from mpc_cover.view.benchmark import Curve, Row, draw_history, print_benchmark, print_steps

GOOD = Row("ours", 0.1, 1.25, 1.0, 0.0, 100.0, 1.2, 0.0, 0.0, 0.0, 0.71, 0.7, 33, "all is well", "", holds=True)
NOTHING = Row("absent", *[None] * 12, "not installed: pip install [x]", "", holds=False)


def printed(show, *arguments, width=160):
    console = Console(file=io.StringIO(), width=width, color_system=None)
    show(*arguments, console)
    return console.file.getvalue()


def test_each_peer_has_a_line_and_a_reason():
    bad = replace(GOOD, name="other", ratio=7.0, violation_path=0.25, worst="separation -0.25 m (a1 - a2)", holds=False)
    text = printed(print_benchmark, [GOOD, bad, NOTHING], "a title")
    assert "a title" in text
    assert "100.00" in text
    assert "7.0" in text
    assert "[s]" in text
    assert "other: all is well; violates separation -0.25 m (a1 - a2)" in text
    assert "absent: not installed: pip install [x]" in text


def test_what_is_not_finite_is_no_number_in_json():
    row = replace(GOOD, cost_m=float("inf"))
    assert row.to_dict()["cost_m"] is None
    assert row.to_dict()["time_s"] == 1.25


def test_parts_of_a_step_are_a_table():
    text = printed(print_steps, {"QP solve": (3.5, 9.0, 0.7), "step": (5.0, 12.0, 1.0)}, "one step")
    assert "3.50 ms" in text
    assert "70.0 %" in text


@pytest.mark.parametrize(
    "curves",
    [
        [Curve("ours", [0.0, 0.5, 1.0], [900.0, 2.0, 0.0], 1.0), Curve("other", [0.0, 30.0], [900.0, 0.4], 60.0)],
        [Curve("ours", [0.0], [0.0], 0.0)],
        [],
    ],
)
def test_curves_are_drawn_whatever_they_are(curves, tmp_path):
    file = draw_history(curves, "box-3", tmp_path / "bench.png")
    content = file.read_bytes()
    assert content.startswith(b"\x89PNG")
    assert np.frombuffer(content[16:24], ">u4").min() > 500
