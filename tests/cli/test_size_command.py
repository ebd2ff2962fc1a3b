"""`mpc-cover size`: what it prints and draws, and sizes that make no sense."""

import json
from pathlib import Path

import pytest


def test_size_answers_and_draws(run):
    status, out, _ = run("size", "--rate", 0.1, "--agents", "8", "--seeds", 1, "--out", "s")
    assert status == 0
    assert "says 12 agents" in out
    assert "N =   8, potential law, 1 seeds: a round of" in out
    assert {path.name for path in Path("s").iterdir()} == {"figure-1.1.png", "figure-1.2.png", "size.json"}
    saved = json.loads(Path("s/size.json").read_text())
    assert saved["agents_needed"] == 12
    assert 0.0 < saved["potential"][0]["model_mean_absolute_error"] < 0.5


def test_the_model_the_simulation_and_the_doubt_are_side_by_side(run):
    status, out, _ = run("size", "--rate", 0.1, "--agents", "2,8", "--seeds", 1, "--json")
    data = json.loads(out)
    assert status == 0
    assert data["agents_needed"] == 12
    assert data["agents_needed_simulated"] == {"potential": 8, "receding_horizon": None}
    _, text, _ = run("size", "--rate", 0.1, "--agents", "2", "--seeds", 1)
    assert "says 12 agents" in text
    assert "none of them is fast enough: try more with --agents" in text
    assert "differ from the model's by up to" in text


def test_size_by_the_model_alone_is_json(run):
    status, out, _ = run("size", "--agents", "1,100000", "--seeds", 0, "--json")
    data = json.loads(out)
    assert status == 0
    assert [row["agents"] for row in data["table"]] == [1, 100000]
    assert data["table"][1]["rate_hz"] is None, "everything is seen at rest"
    assert data["potential"] == []


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--area", -1], "--area: -1.0: must be greater than 0"),
        (["--area", "nan"], "--area"),
        (["--radius", 7], "--radius: 7.0: its disc must be smaller"),
        (["--speed", 3], "--speed: 3.0: must be at most 2"),
        (["--cover", 1], "--cover: 1.0: must be greater than 0 and less than 1"),
        (["--rate", 0], "--rate: 0.0: must be a number of Hz greater than 0"),
        (["--rate", "inf"], "--rate: inf"),
        (["--rate", 1e9], "--rate: 1000000000.0: is impossible: must be at most 0.75 Hz"),
        (["--agents", "x"], "--agents x: must be whole numbers"),
        (["--agents", ","], "--agents: is empty"),
        (["--agents", "0"], "--agents: 0: must be between 1 and 200"),
        (["--agents", "150"], "see the wanted part at rest"),
        (["--area", "1e8"], "cells to simulate"),
    ],
)
def test_sizes_that_make_no_sense(refused, arguments, message):
    assert message in refused("size", *arguments)


def test_an_answer_that_cannot_be_written_is_refused_before_the_work(refused):
    Path("taken").write_text("a file")
    assert "--out taken: cannot be written" in refused("size", "--out", "taken")
