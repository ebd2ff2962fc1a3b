"""After a fault the old ways are worth something: they cover what they did, more slowly or with less."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from closed_loop import PERIOD, small_mission
from motions import UNLIMITED

from mpc_cover.coverage.nearest import remaining_weight
from mpc_cover.model.constraint_tightening import slowed, without_lost
from mpc_cover.model.fleet_constraints import FleetConstraints
from mpc_cover.planning.candidate import evaluate_guess
from mpc_cover.planning.initial_guess.guess import GuessKind
from mpc_cover.planning.initial_guess.plan_repair import PlanRepair
from mpc_cover.planning.planner import Planner
from mpc_cover.planning.task import Task


def planned(mission):
    """Return a plan for all of a mission."""
    fleet = FleetConstraints.of(mission.fleet)
    weight = np.ones((1, mission.field.size))
    task = Task(fleet, mission.field.cell, weight, fleet.start, np.zeros_like(fleet.start), 0.0, PERIOD)
    candidate = Planner("piqp").quick(task, UNLIMITED)
    assert candidate.complete
    return task, candidate.plan


def repaired_plan(task, old):
    """Return the better of the repairs of an old plan."""
    return min((evaluate_guess(task, guess) for guess in PlanRepair().guesses(task, old)), key=lambda one: one.rank)


def rest_of(task, plan, done, fleet):
    """Return the task of another fleet after some samples of a plan."""
    start = {"position": plan.position[done], "velocity": plan.velocity[done], "start_time": done * PERIOD}
    return replace(task, fleet=fleet, **start)


def test_whoever_is_slower_flies_the_same_ways_and_covers_as_much():
    task, plan = planned(small_mission())
    fleet = slowed(task.fleet, np.array([1.0, 0.5]))
    found = repaired_plan(rest_of(task, plan, 0, fleet), plan)
    assert found.kind is GuessKind.REPAIR
    assert found.cost == 0.0
    assert (np.linalg.norm(found.plan.velocity, axis=2) <= fleet.speed_max + 1e-9).all()
    assert found.plan.steps > plan.steps


def test_what_the_lost_leave_over_is_flown_to_in_the_end():
    task, plan = planned(small_mission())
    fleet = without_lost(task.fleet, np.array([True, False]))
    begun = replace(rest_of(task, plan, 4, fleet), velocity=plan.velocity[4] * [[0.0], [1.0]])
    found = repaired_plan(begun, plan)
    alone = plan.position[4:].copy()
    alone[:, 0] = alone[:1, 0]
    without_tour = remaining_weight(alone, task.cell, fleet.radius, task.weight) > 0.0
    assert (begun.remaining_after(found.plan) > 0.0).sum() < 0.1 * without_tour.sum()
    assert not found.plan.velocity[:, 0].any()
    np.testing.assert_array_equal(found.plan.position[:, 0], np.tile(plan.position[4, 0], (found.plan.steps + 1, 1)))
