"""Paths along a shape: they pass every cell, share the work evenly, and turn and move with the shape."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from flights import fleet_of
from motions import PERIOD
from shapes import SHAPES, ring

from mpc_cover.planning.initial_guess.boustrophedon import sweep_guesses
from mpc_cover.planning.initial_guess.guess import GuessKind
from mpc_cover.planning.initial_guess.path_comparison import needed_range, shorter
from mpc_cover.planning.initial_guess.path_geometry import leg_distance, path_length
from mpc_cover.planning.initial_guess.shape_tour import ShapeTour
from mpc_cover.planning.multistart import systematic_guesses
from mpc_cover.planning.task import Task


def task_on(cell, start=None, **changes):
    """Return the task of covering cells, from three places near the lowest of them if no start is given."""
    if start is None:
        offset = np.zeros((3, cell.shape[1]))
        offset[1, 0] = offset[2, 1] = 1.0
        start = cell[np.lexsort(cell.T)[0]] + offset
    fleet = fleet_of(start, **changes)
    return Task(fleet, cell, np.ones((1, len(cell))), start, np.zeros_like(start), 0.0, PERIOD)


def passed_at(paths, cell):
    """Return the distance of each cell to the paths' legs."""
    legs = [leg_distance(cell, a, b)[0] for path in paths for a, b in pairwise(path)]
    return np.min(legs, axis=0)


def flight_times(task, guess):
    """Return each agent's time at full speed, approach included, 0 for whoever stays."""
    paths = zip(task.position, guess.paths, task.fleet.speed_max, strict=True)
    return np.array([path_length(np.concatenate([here[None], path])) / speed for here, path, speed in paths])


@pytest.mark.parametrize("name", SHAPES)
def test_every_cell_is_within_the_sensing_radius_of_a_path_inside_the_bounding_box(name):
    task = task_on(SHAPES[name]())
    guesses = list(ShapeTour().guesses(task))
    assert len(guesses) >= task.fleet.dimension
    for guess in guesses:
        assert passed_at(guess.paths, task.cell).max() <= 1.0 + 1e-6
        points = np.concatenate(guess.paths)
        assert (points >= task.cell.min(axis=0) - 1e-9).all()
        assert (points <= task.cell.max(axis=0) + 1e-9).all()


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("speed", [(1.0, 1.0, 1.0), (2.0, 1.0, 0.5)])
def test_nobody_works_much_longer_than_the_fleet_needs_together(name, speed):
    task = task_on(SHAPES[name](), speed_max=np.array(speed))
    guess = next(ShapeTour().guesses(task))
    times = flight_times(task, guess)
    longest_cell = np.linalg.norm(task.cell[:, None] - task.position, axis=2).max()
    assert times.max() <= (times * speed).sum() / sum(speed) + longest_cell / min(speed)
    alone = path_length(guess.paths[int(np.argmax(times))])
    assert alone < (times * speed).sum()


@pytest.mark.parametrize(("name", "centre_line"), [("ring", 32.0), ("diagonal", 17.0), ("lanes", 46.0)])
def test_a_thin_shape_is_flown_once_along_its_centre_line(name, centre_line):
    guess = next(ShapeTour().guesses(task_on(SHAPES[name]())))
    assert sum(path_length(path) for path in guess.paths) <= centre_line


def test_on_a_ring_sweeps_of_the_bounding_box_take_far_longer():
    task = task_on(ring())
    shape = flight_times(task, next(ShapeTour().guesses(task))).max()
    sweeps = sweep_guesses(task.fleet, task.cell, task.weight, task.position, PERIOD)
    assert shape < 0.9 * min(flight_times(task, guess).max() for guess in sweeps)


def turned(points):
    """Return points turned by a right angle."""
    return np.stack([-points[:, 1], points[:, 0]], axis=1)


@pytest.mark.parametrize("name", ["ring", "diagonal", "lanes", "islands"])
@pytest.mark.parametrize("move", [turned, lambda points: points + 4096.0])
def test_paths_turn_and_move_with_the_shape(name, move):
    task = task_on(SHAPES[name]())
    moved = task_on(move(task.cell), move(task.position))
    one, two = (flight_times(each, next(ShapeTour().guesses(each))).max() for each in (task, moved))
    assert two == pytest.approx(one, rel=0.1)


def test_agents_that_cannot_measure_stay_where_they_are():
    cell = ring()
    start = np.array([[1.0, 1.0], [2.0, 1.0], [1.0, 2.0]])
    task = task_on(cell, start, radius=np.array([[1.0], [-np.inf], [1.0]]))
    paths = next(ShapeTour().guesses(task)).paths
    assert paths[1].tolist() == [[2.0, 1.0]]
    assert passed_at([paths[0], paths[2]], cell).max() <= 1.0


def test_one_cell_is_enough():
    task = task_on(np.array([[3.0, 4.0]]), np.array([[0.0, 0.0], [3.0, 1.0]]))
    guess = next(ShapeTour().guesses(task))
    assert [len(path) for path in guess.paths].count(1) >= 1
    assert np.concatenate(guess.paths)[-1] == pytest.approx([3.0, 4.0])


def test_small_cells_that_are_taken_together_are_all_passed():
    side = np.arange(120) * 0.1
    cell = np.stack(np.meshgrid(side, side, indexing="ij"), axis=-1).reshape(-1, 2)
    task = task_on(cell)
    for guess in ShapeTour().guesses(task):
        assert passed_at(guess.paths, cell).max() <= 1.0


def test_in_file_a_fleet_stays_together_and_everyone_apart():
    task = task_on(ring(), communication_range=3.0, separation_min=0.5)
    guesses = list(ShapeTour().guesses(task))
    together = [guess for guess in guesses if needed_range(task, guess) <= 3.0]
    assert together
    assert len(together) < len(guesses)
    assert passed_at(together[0].paths, task.cell).max() <= 1.0
    first, last = shorter(task, guesses, [together[0]])
    assert not first  # no shorter than itself
    assert {guess.origin.kind for guess in last} == {GuessKind.SHAPE_APART}


def test_paths_come_before_sweeps_where_they_are_much_shorter_and_nowhere_else():
    task = task_on(ring())
    kinds = [guess.origin.kind for guess in systematic_guesses(task)]
    assert kinds[0] is GuessKind.SHAPE
    strip = np.array([[x, y] for x in np.arange(20) * 0.5 for y in (0.25, 0.75)])
    assert not any(guess.origin.kind is GuessKind.SHAPE for guess in systematic_guesses(task_on(strip)))
