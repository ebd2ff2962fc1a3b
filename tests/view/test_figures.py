"""The figures of a run: what files there are, and what is drawn in them."""

from __future__ import annotations

import struct
import subprocess
import sys
from dataclasses import replace

import matplotlib as mpl
import numpy as np
import pytest
from flights import box3_flight, mission_of, random_walk, trajectory_of
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from mpc_cover.errors import UserError
from mpc_cover.verification.check import check_trajectory
from mpc_cover.view import figures, map_agents, maps, series
from mpc_cover.view.figures import draw_overview, draw_run

DEFAULTS = {"input_max_m_per_s2": 1.5, "speed_max_m_per_s": 1.5}


@pytest.fixture(scope="module")
def flight():
    return box3_flight()


@pytest.fixture(scope="module")
def mixed():
    """Four agents, three magnitudes, a polygon with a hole."""
    agents = [
        {"id": "a1", "start_m": [1, 1], "sensing_radius_m": {"wind": 1.2, "light": 0.8}},
        {"id": "a2", "start_m": [3, 1], "sensing_radius_m": {"light": 1.0, "heat": 1.5}},
        {"id": "a3", "start_m": [1, 4], "sensing_radius_m": {"heat": 1.0, "wind": 1.0}, "speed_max_m_per_s": 2.0},
        {"id": "a4", "start_m": [7, 6], "sensing_radius_m": 1.0},
    ]
    outline = [[0, 0], [12, 0], [12, 5], [8, 9], [0, 9]]
    hole = [[4, 3], [6, 3], [6, 5], [4, 5]]
    raw = {
        "schema": 1,
        "name": "mixed",
        "area": {"shape": {"kind": "polygon", "outline_m": outline, "holes_m": [hole]}, "cell_size_m": 0.5},
        "magnitudes": ["wind", "light", "heat"],
        "fleet": {"defaults": DEFAULTS, "communication_range_m": 7.0, "agents": agents},
    }
    return random_walk(mission_of(raw), 40)


def box_mission(starts, upper, **fleet):
    raw = {
        "schema": 1,
        "name": "box",
        "area": {"shape": {"kind": "box", "min_m": [0.0] * len(upper), "max_m": upper}, "cell_size_m": 0.5},
        "fleet": {
            "defaults": DEFAULTS | {"sensing_radius_m": 1.0},
            "agents": [{"id": f"a{i + 1}", "start_m": start} for i, start in enumerate(starts)],
            **fleet,
        },
    }
    return mission_of(raw)


def size_of(png):
    data = png.read_bytes()
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    return struct.unpack(">II", data[16:24])


def test_files_of_a_run(flight, tmp_path):
    written = draw_run(flight, tmp_path / "run" / "figures", np.full(45, 0.05), check_trajectory(flight))
    names = [file.name for file in written]
    assert names == [
        "overview.png",
        "map.png",
        "coverage.png",
        "speeds.png",
        "inputs.png",
        "distances.png",
        "steps.png",
    ]
    for file in written:
        width, height = size_of(file)
        assert width >= 1000
        assert height >= 600
        assert file.stat().st_size > 10_000


def test_same_run_same_bytes(flight, tmp_path, monkeypatch):
    monkeypatch.setattr(figures, "_panels", lambda *_: {})
    monkeypatch.setattr(figures, "draw_overview", lambda *_: figures.new_figure(2, 2))
    first = draw_run(flight, tmp_path / "a")
    with mpl.rc_context({"font.size": 30.0, "axes.facecolor": "black"}):
        second = draw_run(flight, tmp_path / "b")
    assert [file.read_bytes() for file in first] == [file.read_bytes() for file in second]


def test_one_map_for_each_of_several_magnitudes(mixed, tmp_path, monkeypatch):
    monkeypatch.setattr(figures, "_panels", lambda *_: {})
    monkeypatch.setattr(figures, "draw_overview", lambda *_: figures.new_figure(2, 2))
    names = [file.name for file in draw_run(mixed, tmp_path)]
    assert names == ["overview.png", "map.png", "map-wind.png", "map-light.png", "map-heat.png"]


@pytest.mark.parametrize(("steps", "panels"), [(None, 5), (np.full(3, 0.1), 6)])
def test_overview_has_all_panels(flight, steps, panels):
    overview = draw_overview(flight, steps, check_trajectory(flight))
    titles = [axes.get_title(loc="left") or axes.get_title() for axes in overview.axes]
    assert len(titles) == panels + 1  # the map's colour bar
    assert "all 15 checks hold" in overview.get_suptitle()


def test_overview_of_several_magnitudes_has_their_maps(mixed):
    overview = draw_overview(mixed, None, None)
    assert len(overview.axes) == 2 * (1 + 3) + 4  # each map has a colour bar


def test_overview_says_what_is_violated(flight):
    position = flight.position.copy()
    position[3, 0, 0] += 1.0
    bad = replace(flight, position=position)
    assert "VIOLATION: dynamics of position" in draw_overview(bad, None, check_trajectory(bad)).get_suptitle()


def test_overview_of_a_flight_that_is_not_complete_is_not_green(flight):
    assert np.isinf(flight.covered_at).any()
    overview = draw_overview(flight, None, check_trajectory(flight))
    assert overview.get_suptitle().startswith("NOT COMPLETE")
    done = replace(flight, covered_at=np.minimum(flight.covered_at, 1.0))
    complete = draw_overview(done, None, check_trajectory(flight))
    assert "NOT COMPLETE" not in complete.get_suptitle()
    assert overview._suptitle.get_color() != complete._suptitle.get_color()


def test_overview_never_rounds_coverage_up(flight):
    covered_at = np.ones(400)
    covered_at[0] = np.inf
    text = draw_overview(replace(flight, covered_at=covered_at), None, None).get_suptitle()
    assert "99.75 % covered" in text


def test_a_single_agent_has_no_distances(tmp_path):
    flight = random_walk(box_mission([[1.0, 1.0]], [4.0, 4.0]), 20)
    names = {file.name for file in draw_run(flight, tmp_path, np.array([0.1, 0.7]))}
    assert "distances.png" not in names
    assert "steps.png" in names


def test_a_mission_in_space_is_projected(tmp_path):
    flight = random_walk(box_mission([[1.0, 1.0, 1.0], [3.0, 3.0, 1.0]], [4.0, 4.0, 3.0]), 20)
    assert draw_run(flight, tmp_path)
    axes = Figure().add_subplot()
    maps.draw_map(axes, flight)
    assert "projected to x-y" in axes.get_title()


def test_a_mission_in_space_has_altitudes_between_their_bounds(tmp_path):
    flight = random_walk(box_mission([[1.0, 1.0, 1.0], [3.0, 3.0, 1.0]], [4.0, 4.0, 3.0]), 20)
    assert "altitudes.png" in {file.name for file in draw_run(flight, tmp_path)}
    axes = Figure().add_subplot()
    series.draw_altitudes(axes, flight)
    for line, altitude in zip(axes.lines, flight.position[..., 2].T, strict=False):
        assert (line.get_ydata()[0], line.get_ydata()[-1]) == pytest.approx((altitude[0], altitude[-1]))
    assert {text.get_text() for text in axes.texts} == {"highest 3 m", "lowest 0 m"}


def test_a_lost_agent_is_crossed_out_and_has_no_disc(flight):
    axes = Figure().add_subplot()
    maps.draw_map(axes, replace(flight, meta={**flight.meta, "lost": {"a2": 2.0}}))
    assert {text.get_text() for text in axes.texts} == {"a1", "a2 lost at 2.0 s", "a3"}
    assert len([patch for patch in axes.patches if isinstance(patch, Circle)]) == 2
    assert len(axes.collections[0].get_segments()) == 1
    assert [line.get_marker() for line in axes.lines].count("X") == 1


def test_a_fleet_that_is_lost_as_a_whole_has_no_tree(flight):
    axes = Figure().add_subplot()
    maps.draw_map(axes, replace(flight, meta={**flight.meta, "lost": {"a1": 1.0, "a2": 2.0, "a3": 2.0}}))
    assert not [segments for each in axes.collections for segments in each.get_segments()]


def test_names_of_neighbours_do_not_overlap():
    starts = [[1.0 + 0.8 * (i % 4), 1.0 + 0.4 * (i // 4)] for i in range(12)]
    mission = box_mission(starts, [12.0, 9.0])
    axes = figures.new_figure(7.5, 7.2).add_subplot()
    maps.draw_map(axes, trajectory_of(mission, np.zeros((3, 12, 2))))
    boxes = [text.get_window_extent() for text in axes.texts]
    overlaps = [one.overlaps(other) for i, one in enumerate(boxes) for other in boxes[:i]]
    assert len(boxes) == 12
    assert sum(overlaps) <= 2


def test_a_crowd_and_a_fleet_at_rest(tmp_path):
    starts = [[0.5 + (i % 5), 0.5 + i // 5] for i in range(20)]
    mission = box_mission(starts, [5.0, 5.0], communication_range_m=3.0, separation_min_m=0.2)
    at_rest = trajectory_of(mission, np.zeros((3, 20, 2)))
    assert draw_run(at_rest, tmp_path, np.array([]), check_trajectory(at_rest))


def test_folder_that_cannot_be_made_is_the_users_mistake(flight, tmp_path):
    taken = tmp_path / "taken"
    taken.write_text("a file")
    with pytest.raises(UserError, match=r"figures: cannot write to .*taken"):
        draw_run(flight, taken)


def test_map_shows_cells_paths_ends_and_tree(flight):
    axes = Figure().add_subplot()
    maps.draw_map(axes, flight)
    assert axes.get_aspect() == 1.0
    never, times = (image.get_array() for image in axes.images)
    assert times.shape == (20, 20)
    assert int(never.sum()) == 6
    assert never[0, 0] == 1.0
    assert times.mask.sum() == 6
    known = np.isfinite(flight.covered_at)
    np.testing.assert_array_equal(np.sort(times.compressed()), np.sort(flight.covered_at[known]))
    assert len([patch for patch in axes.patches if isinstance(patch, Circle)]) == 3
    assert len(axes.collections[0].get_segments()) == 2
    assert {text.get_text() for text in axes.texts} == {"a1", "a2", "a3"}


def test_map_shows_where_somebody_left_the_box(flight):
    position = flight.position.copy()
    position[10, 0] = [-7.0, 4.0]
    axes = Figure().add_subplot()
    maps.draw_map(axes, replace(flight, position=position))
    assert axes.get_xlim()[0] < -7.0


def test_map_of_a_magnitude_shows_only_who_measures_it(mixed):
    axes = Figure().add_subplot()
    maps.draw_map(axes, mixed, 2)
    assert {text.get_text() for text in axes.texts} == {"a2", "a3", "a4"}
    assert "heat" in axes.get_title()


def test_tree_of_a_known_fleet():
    position = np.array([[0.0, 0.0], [5.0, 0.0], [1.0, 0.0], [3.0, 0.0]])
    assert {tuple(sorted(edge)) for edge in map_agents.spanning_tree(position)} == {(0, 2), (2, 3), (1, 3)}
    assert map_agents.spanning_tree(position[:1]) == []


def test_coverage_curve_ends_at_what_is_covered(flight):
    axes = Figure().add_subplot()
    series.draw_coverage(axes, flight)
    assert axes.lines[0].get_ydata()[-1] == pytest.approx(98.5)
    assert axes.get_title() == "Covered: 98.5 % of 400 cells"
    assert "99 %: never" in axes.texts[0].get_text()


def test_distances_are_drawn_between_the_samples(flight):
    axes = Figure().add_subplot()
    series.draw_distances(axes, flight)
    pairs = axes.lines[:3]
    assert all(len(line.get_xdata()) > 10 * len(flight.time) for line in pairs)
    closest = min(line.get_ydata().min() for line in pairs)
    assert closest == pytest.approx(1.2953, abs=1e-3)
    assert {text.get_text() for text in axes.texts} == {
        r"separation $\rho_B$ = 0.5 m",
        r"communication range $\rho_C$ = 5.5 m",
    }


def test_the_tree_is_that_of_the_living_and_deaths_are_marked():
    mission = box_mission([[1.0, 1.0], [2.0, 1.0], [3.5, 1.0]], [20.0, 4.0], communication_range_m=3.0)
    away = np.zeros((20, 3, 2))
    away[:, 2, 0] = 0.2  # a3 goes on and on, dead at 2 s: (0.5 * 0.2 * 2^2) m further than 1.5 m from a2
    flight = trajectory_of(mission, away)
    died = replace(flight, meta={**flight.meta, "lost": {"a3": 2.0}})
    curves, notes = {}, {}
    for name, each in (("alive", flight), ("dead", died)):
        axes = Figure().add_subplot()
        series.draw_distances(axes, each)
        curves[name] = {line.get_label(): line for line in axes.lines}
        notes[name] = {text.get_text(): text for text in axes.texts}
    time, alive = curves["alive"]["longest tree edge"].get_data()
    np.testing.assert_allclose(alive, 1.5 + 0.1 * time**2)
    time, living = curves["dead"]["tree edge (living)"].get_data()
    np.testing.assert_allclose(living, np.where(time < 2.0, 1.5 + 0.1 * time**2, 1.0))
    assert notes["dead"]["a3 lost"].xy[0] == 2.0
    assert "a3 lost" not in notes["alive"]
    widow = replace(flight, meta={**flight.meta, "lost": {"a3": 2.0, "a1": 2.0}})
    axes = Figure().add_subplot()
    series.draw_distances(axes, widow)  # one is left, who has no tree
    edge = next(line for line in axes.lines if "tree" in line.get_label()).get_ydata()
    assert np.isfinite(edge).sum() == (time < 2.0).sum()


def test_speeds_and_inputs_have_a_curve_each_and_a_bound(flight):
    axes = Figure().add_subplot()
    series.draw_speeds(axes, flight)
    assert [line.get_label() for line in axes.lines[:3]] == ["a1", "a2", "a3"]
    assert axes.lines[3].get_ydata()[0] == 1.5
    axes = Figure().add_subplot()
    series.draw_inputs(axes, flight)
    assert len(axes.patches) == 3


def test_late_steps_are_marked():
    axes = Figure().add_subplot()
    series.draw_step_times(axes, np.array([0.1, 0.6, 0.2]), 0.5)
    assert axes.get_title() == "Step times: 1 of 3 late"
    assert [len(container) for container in axes.containers] == [2, 1]


def test_nothing_but_the_view_imports_matplotlib():
    script = (
        "import sys, mpc_cover.verification.check, mpc_cover.verification.summary, mpc_cover.view.tables;"
        "sys.exit('matplotlib' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", script], check=False).returncode == 0


def test_pyplot_stays_out():
    script = "import sys, mpc_cover.view.figures; sys.exit('matplotlib.pyplot' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", script], check=False).returncode == 0
