"""A convoy keeps every distance; a crowd that no other plan moves is moved by it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from flights import fleet_of
from hypothesis import given, settings
from hypothesis import strategies as st
from motions import EXHAUSTED, PERIOD, UNLIMITED, grid

from mpc_cover.planning.candidate import evaluate_guess
from mpc_cover.planning.free_horizon import plan_free_horizon
from mpc_cover.planning.initial_guess.formation import formation_flight
from mpc_cover.planning.initial_guess.guess import GuessKind, rest_guess
from mpc_cover.planning.multistart import Search
from mpc_cover.planning.task import Task
from mpc_cover.verification.motion import verify_motion
from solvers.backends.registry import make_backend

SIDE = 4.0


def crowd(start, speed, force, radius, lost=(), side=SIDE):
    """Return all of a square to be covered by a fleet whose distances are what they may be, exactly."""
    length = [np.linalg.norm(p - q) for i, p in enumerate(start) for q in start[:i]] or [1.0]
    fleet = fleet_of(
        start,
        speed_max=np.array(speed),
        input_max=np.array(force),
        radius=np.array(radius),
        separation_min=min(length),
        communication_range=max(length),
        motion_min=np.zeros(2),
        motion_max=np.full(2, side),
        lost=lost,
    )
    cell = grid(round(2 * side), 0.5)
    weight = np.ones((fleet.radius.shape[1], len(cell)))
    return Task(fleet, cell, weight, start, np.zeros_like(start), 0.0, PERIOD)


@st.composite
def crowds(draw):
    agents = draw(st.integers(1, 4))
    place = st.floats(0.0, SIDE)
    start = np.array([[draw(place), draw(place)] for _ in range(agents)])
    limit = st.lists(st.floats(0.2, 2.0), min_size=agents, max_size=agents)
    radius = [[draw(st.sampled_from([-np.inf, 0.6, 1.0])), 0.8] for _ in range(agents)]
    return crowd(start, draw(limit), draw(limit), radius)


@settings(max_examples=60, deadline=None)
@given(crowds())
def test_it_keeps_distances_limits_and_the_box_and_measures_what_it_can(task):
    motion = formation_flight(task, UNLIMITED)
    if motion is None:
        return
    moved = motion.position - motion.position[0]
    np.testing.assert_allclose(moved, np.broadcast_to(moved[:, :1], moved.shape), atol=1e-9)
    force = np.diff(motion.velocity, axis=0) / PERIOD
    time = PERIOD * np.arange(motion.steps + 1)
    start = (task.position, task.velocity)
    report = verify_motion(
        task.fleet, time, motion.position, motion.velocity, force, tolerance=1e-6, at_rest=True, start=start
    )
    assert report.holds, report.failures
    # wherever the body can be brought within reach of a cell, it was
    low, high = -task.position.min(axis=0), SIDE - task.position.max(axis=0)
    reach = task.cell[None] - task.position[:, None]
    spare = np.linalg.norm(reach - np.clip(reach, low, high), axis=2)
    able = (spare[:, None] <= 0.9 * task.fleet.radius[:, :, None]).any(axis=0)
    distance = np.linalg.norm(task.cell - motion.position[:, :, None], axis=3)
    seen = (distance[:, :, None] <= task.fleet.radius[:, :, None]).any(axis=(0, 1))
    assert (seen | ~able).all()


def test_the_dead_stay_and_the_moving_do_not_form_one():
    task = crowd(np.array([[1.0, 1.0], [1.6, 1.0], [3.0, 3.0]]), [1.0] * 3, [1.0] * 3, [[0.8]] * 3, lost=(2,))
    motion = formation_flight(task, UNLIMITED)
    assert np.abs(motion.position[:, 2] - [3.0, 3.0]).max() == 0.0
    assert np.abs(motion.position[:, 0] - [1.0, 1.0]).max() > 1.0
    assert formation_flight(replace(task, velocity=np.full_like(task.velocity, 0.1)), UNLIMITED) is None
    assert (
        formation_flight(replace(task, velocity=np.full_like(task.velocity, 1e-16)), UNLIMITED) is not None
    )  # what rounding leaves
    assert formation_flight(replace(task, weight=0.0 * task.weight), UNLIMITED) is None


@settings(max_examples=40, deadline=None)
@given(crowds(), st.tuples(st.floats(0.0, SIDE), st.floats(0.0, SIDE)))
def test_it_flies_around_the_dead(task, place):
    """What cannot be reached straight on is left; what is measured is measured at the least distance at least."""
    start = np.concatenate([task.position, [place]])
    near = np.linalg.norm(start[:-1] - start[-1], axis=1).min()
    fleet = fleet_of(
        start, separation_min=0.4, motion_min=np.zeros(2), motion_max=np.full(2, SIDE), lost=(len(start) - 1,)
    )
    motion = formation_flight(
        replace(task, fleet=fleet, position=start, velocity=np.zeros_like(start), weight=task.weight[:1]),
        UNLIMITED,
    )
    if motion is None:
        return
    assert np.abs(motion.position[:, -1] - start[-1]).max() == 0.0
    part = np.linspace(0.0, 1.0, 20)[:, None, None, None]  # straight between samples
    every = motion.position[:-1] + part * np.diff(motion.position, axis=0)
    distance = np.linalg.norm(every[:, :, :-1] - every[:, :, -1:], axis=3)
    assert distance.min() >= min(0.4, near) - 1e-6


def test_a_crowd_that_no_qp_sorts_out_moves_all_the_same(monkeypatch):
    """Six agents that may come neither nearer nor farther: every way of their own breaks a distance."""
    start = np.array([[0.5 + 0.6 * i, 0.5 + 0.6 * j] for i in range(3) for j in range(2)])
    task = crowd(start, [1.0] * 6, [1.0] * 6, [[0.5]] * 6, side=6.0)
    task = replace(task, fleet=replace(task.fleet, communication_range=0.65, separation_min=0.59))

    def in_vain(task, backend, steps, *_):
        still = rest_guess(task.position)
        return [evaluate_guess(task, still, steps)]

    monkeypatch.setattr("mpc_cover.planning.min_time.multistart", in_vain)
    found = plan_free_horizon(task, make_backend("piqp"), attempts=1, search=Search(starts=1), budget=UNLIMITED)
    assert found.complete
    assert found.kind is GuessKind.FORMATION
    late = plan_free_horizon(task, make_backend("piqp"), attempts=1, search=Search(starts=1), budget=EXHAUSTED)
    assert late.feasible
    assert not late.idle
