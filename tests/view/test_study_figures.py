"""Figures of a study: what they show, for one run or many, finished or not."""

import numpy as np
import pytest

from mpc_cover.view.study import Series, draw_coverage, pareto_front, study_figures
from mpc_cover.view.style import house_style

LEVEL = np.linspace(0.0, 100.0, 201)


def series(label="mpc 4 s", runs=5, bound=10.0, slow=1.0, reached=100.0):
    end = slow * np.linspace(12.0, 16.0, runs)[:, None]
    curve = np.where(reached >= LEVEL, end * LEVEL / 100.0, np.inf)
    return Series(label, LEVEL, curve, curve[:, 198], slow * np.linspace(5.0, 50.0, 10 * runs), 500.0, bound)


def test_what_is_covered_at_a_time_follows_the_curve():
    one = series(runs=1)
    covered = one.covered(np.array([0.0, 6.0, 12.0, 50.0]))
    assert covered[0] == pytest.approx([0.0, 50.0, 100.0, 100.0], abs=0.5)
    assert series(runs=1, reached=40.0).covered(np.array([50.0]))[0] == [40.0]


def test_the_median_and_the_band_are_those_of_the_runs():
    with house_style():
        figure = draw_coverage("box", [series(), series("sweep", slow=2.0)])
    axes = figure.axes[0]
    middle = axes.lines[-2]
    time, covered = middle.get_data()
    assert np.interp(50.0, covered, time) == pytest.approx(7.0, abs=0.2)
    band = axes.collections[0].get_paths()[0].vertices
    assert band[:, 1].max() == 100.0
    assert [axes.get_title(loc="left") for axes in figure.axes] == ["mpc 4 s", "sweep"]


@pytest.mark.parametrize(
    "missions",
    [
        {"one": [series(runs=1)]},
        {"box": [series(f"mpc {n} s", slow=1.0 + 0.1 * n) for n in range(5)], "disc": [series(bound=None)]},
        {"stalled": [series(reached=60.0), series("sweep", reached=0.0)]},
        {"broken": [Series("mpc", LEVEL, np.full((2, 201), np.inf), np.full(2, np.inf), np.empty(0), 500.0, None)]},
    ],
    ids=["one run", "many", "never", "broken off"],
)
def test_every_figure_can_be_drawn(missions, tmp_path):
    names = []
    for name, figure in study_figures(missions):
        names.append(name)
        figure.savefig(tmp_path / "figure.png", dpi=30)
    assert names == [*(f"coverage-{mission}" for mission in missions), "time-to-99", "step-time", "pareto"]


def test_those_that_never_got_there_are_counted():
    mixed = series(reached=100.0)
    mixed.time_99[3:] = np.inf
    figures = dict(study_figures({"box": [mixed]}))
    assert "2 of 5\nnever" in [text.get_text() for text in figures["time-to-99"].axes[0].texts]


def test_the_front_holds_what_nobody_beats():
    points = [(1.0, 30.0), (2.0, 10.0), (2.0, 9.0), (3.0, 12.0), (4.0, 8.0), (4.5, 8.0)]
    assert pareto_front(points) == [(1.0, 30.0), (2.0, 9.0), (4.0, 8.0)]
