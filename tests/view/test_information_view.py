"""What the pictures and the summary of each kind of information say."""

import json
from io import StringIO

import numpy as np
import pytest
from flights import random_walk
from mission_kinds import KINDS, mission_with
from rich.console import Console

from mpc_cover.mission.load import build_mission
from mpc_cover.verification.check import check_trajectory
from mpc_cover.verification.information_summary import age_history
from mpc_cover.verification.summary import summarise
from mpc_cover.view.figures import draw_overview, draw_run
from mpc_cover.view.tables import print_summary


def flight_of(kind):
    return random_walk(mission_with(KINDS[kind]), 30)


def titles(overview):
    return [axes.get_title(loc="left") or axes.get_title() for axes in overview.axes]


@pytest.mark.parametrize(
    ("kind", "words"),
    [
        ("coverage", "dark: never"),
        ("looks", "dark: fewer than 2 looks"),
        ("effective", "dark: looks come to less than 1.5"),
        ("kalman", "dark: variance above 0.4"),
        ("ageing", "the darker, the older at the end"),
    ],
)
def test_the_map_says_what_dark_means(kind, words):
    assert words in titles(draw_overview(flight_of(kind), None, None))[0]


def test_a_patrol_is_shown_by_its_ages():
    flight = flight_of("ageing")
    overview = draw_overview(flight, None, None)
    ages = overview.axes[[title.startswith("Ages of the cells") for title in titles(overview)].index(True)]
    history = age_history(flight)
    assert history.worst_s.max() > 6.0
    assert f"at most {history.worst_s.max():.1f} s old (limit 6 s)" in overview.get_suptitle()
    worst = next(line for line in ages.lines if line.get_label() == "worst")
    np.testing.assert_array_equal(worst.get_ydata(), history.worst_s)
    # what was never looked at is black, what is in range now is light
    shade = np.ma.filled(overview.axes[0].images[0].get_array(), np.nan).T.ravel()
    age = history.last_s[0]
    np.testing.assert_allclose(np.sort(shade), np.sort(np.clip(age / 6.0, 0.0, 1.0)))


def test_inputs_of_single_integrators_are_not_drawn(tmp_path):
    raw = json.loads(mission_with(None).to_json())
    raw["fleet"]["dynamics"] = "single"
    flight = random_walk(build_mission(raw, "single"), 5)
    assert "inputs.png" not in [file.name for file in draw_run(flight, tmp_path)]


@pytest.mark.parametrize(("kind", "words"), [("ageing", "age limit 6 s"), ("kalman", "target variance 0.4")])
def test_figures_have_units_and_what_they_are_to_be(kind, words):
    flight = flight_of(kind)
    console = Console(width=200, record=True, file=StringIO())
    print_summary(summarise(flight, check_trajectory(flight)), console)
    text = console.export_text()
    assert words in text
    assert "age s" not in text
