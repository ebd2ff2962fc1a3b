"""The figures of chapters 1, 5 and 6: which there are, and what is drawn in them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure

from mpc_cover.studies.fleet_sizing import SizingProblem, measurement_rate
from mpc_cover.studies.sizing_simulation import coverage_curve
from mpc_cover.studies.swarm import run
from mpc_cover.studies.swarm_parameters import KalmanInformation, LookInformation
from mpc_cover.studies.thesis_cases import constrained, free
from mpc_cover.view import sizing_figures, swarm_figures, swarm_maps, swarm_series
from mpc_cover.view.cells import Scale
from mpc_cover.view.style import house_style


@pytest.fixture(scope="module")
def looks():
    return run(constrained(LookInformation(2), maps_every=2), 0)


@pytest.fixture(scope="module")
def kalman():
    return run(constrained(KalmanInformation(enough=0.3), maps_every=2), 0)


def titles(figure):
    return [axes.get_title(loc="left") or axes.get_title() for axes in figure.axes]


def test_snapshots_tell_when_and_how_much_is_left(looks):
    figure = swarm_figures.figure_6_2(looks, watched=3)
    maps = [title for title in titles(figure) if title.startswith("t = ")]
    assert len(maps) == 8
    assert maps[-1].endswith(": 0 % left")
    assert "a4 (the bigger dot)" in figure.get_suptitle()
    shown = figure.axes[2].images[0].get_array()
    index = swarm_maps.moments(looks, 8)[2]
    assert shown.shape == (20, 20)
    assert float(shown.sum()) == pytest.approx(looks.maps.own[index, 3].sum())
    assert len(figure.axes[2].collections[0].get_segments()) >= 7


def test_what_is_nearly_nothing_is_not_shown_as_nothing(looks):
    left = looks.maps.own[:, 0].copy()
    left[-1, 0] = 1e-3
    own = looks.maps.own.copy()
    own[:, 0] = left
    figure = swarm_figures.figure_6_2(replace(looks, maps=replace(looks.maps, own=own)))
    assert titles(figure)[7].endswith("< 0.1 % left")


def test_stochastic_snapshots_show_the_estimate_below(kalman):
    for figure in (swarm_figures.figure_5_4(kalman), swarm_figures.figure_6_5(kalman, 1)):
        errors = [float(title.split()[-1]) for title in titles(figure) if title.startswith("estimate")]
        assert len(errors) == 4
        assert errors[-1] < errors[0]
    field = swarm_figures.figure_5_3(kalman)
    np.testing.assert_allclose(np.sort(field.axes[0].images[0].get_array().ravel()), np.sort(kalman.truth))


def test_distances_and_what_is_known(looks):
    at_once = run(constrained(LookInformation(2), 0), 0)
    figure = swarm_figures.figure_6_3(looks, at_once, watched=2)
    distance, known = figure.axes
    assert {text.get_text() for text in distance.texts} == {r"$\rho_B$ = 0.5 m", r"$\rho_C$ = 5.5 m"}
    curves = {line.get_label(): line for line in known.lines}
    np.testing.assert_allclose(curves["a3's estimate, delayed"].get_ydata(), 100.0 * looks.own_residual[:, 2])
    np.testing.assert_allclose(curves["with global knowledge"].get_ydata(), 100.0 * at_once.residual)
    assert len([text for text in known.texts if text.get_text().startswith("all covered")]) == 2
    closest = next(line for line in distance.lines if line.get_label() == "closest pair")
    assert closest.get_ydata().min() >= 0.5 - 1e-9


def test_a_run_that_does_not_finish_says_never():
    cut = free(LookInformation(3), maps_every=1)
    short = run(replace(cut, swarm=replace(cut.swarm, time_limit_s=3.0)), 0)
    axes = Figure().add_subplot()
    swarm_series.draw_left(axes, short)
    assert "0 % left: never" in axes.texts[0].get_text()
    assert swarm_figures.figure_5_1(short).axes
    assert swarm_figures.figure_5_2(short).axes


def test_model_dashed_simulation_solid():
    problem = SizingProblem(100.0, 1.0, 1.5)
    curve = coverage_curve(problem, 10, range(2))
    axes = sizing_figures.figure_1_1([curve]).axes[0]
    simulated, model = axes.lines[:2]
    assert (simulated.get_linestyle(), model.get_linestyle()) == ("-", "--")
    assert f"{100.0 * curve.error.mean_absolute:.1f} %" in simulated.get_label()
    np.testing.assert_allclose(model.get_ydata(), 100.0 * curve.model)
    agents = np.array([5.0, 10.0, 500.0])
    rate = np.array([measurement_rate(problem, int(number)) for number in agents])
    axes = sizing_figures.figure_1_2(agents, rate, 0.95, [curve]).axes[0]
    assert axes.lines[0].get_xdata().tolist() == [5.0, 10.0], "an infinite rate has no point"
    assert "95 %" in axes.get_title(loc="left") + axes.get_title()
    assert sizing_figures.figure_1_2(agents, rate, 0.95).axes


def test_cells_above_each_other_share_a_pixel():
    field = constrained(LookInformation(1)).build(np.random.default_rng(0))[1]
    tall = replace(
        field,
        cell=np.concatenate([np.pad(field.cell, ((0, 0), (0, 1)))] * 2),
        shape_min=np.zeros(3),
        shape_max=np.array([10.0, 10.0, 1.0]),
    )
    axes = Figure().add_subplot()
    value = np.concatenate([np.zeros(field.size), np.ones(field.size)])
    with house_style():
        image = swarm_maps.draw_cells(axes, tall, value, Scale(swarm_maps.OWED, 0.0, 1.0))
    assert (image.get_array() == 0.5).all()
