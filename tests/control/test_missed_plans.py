"""A message may be lost: who goes on along the last plan must not meet who flies the new one."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from flights import fleet_of
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from test_receding_horizon import PERIOD, small_mission

from mpc_cover.control.constraint_relaxation import longest_edge, strict_bounds
from mpc_cover.control.receding_horizon import RecedingHorizon
from mpc_cover.model.motion import roll_out
from mpc_cover.model.trajectory import Trajectory
from mpc_cover.planning.scp import SCPResult
from mpc_cover.service.run.simulate import simulate
from mpc_cover.verification.check import check_trajectory
from mpc_cover.verification.path import Path
from mpc_cover.verification.separation import smallest_separation


def random_path(rng, start, velocity, steps=2):
    force = rng.uniform(-1.5, 1.5, (steps, *start.shape))
    position, velocities = roll_out(start, velocity, force, PERIOD)
    return Path(PERIOD * np.arange(steps + 1.0), position, velocities, force)


@settings(max_examples=80, deadline=None)
@given(st.integers(2, 4), st.integers(0, 2**32 - 1))
def test_what_is_called_safe_is_so_whoever_missed_it(agents, seed):
    rng = np.random.default_rng(seed)
    start = rng.uniform(0.0, 3.0, (agents, 2))
    fleet = fleet_of(start, separation_min=0.3, communication_range=2.5)
    velocity = rng.uniform(-0.5, 0.5, start.shape)
    new, old = random_path(rng, start, velocity), random_path(rng, start, velocity)
    assume(smallest_separation(old).value >= 0.3)  # what is flown so far was verified when it was sent
    apart, longest = [], []
    for missed in product((False, True), repeat=agents):
        pick = np.array(missed)[None, :, None]
        arrays = [
            np.where(pick, *pair) for pair in zip(*((p.position, p.velocity, p.force) for p in (old, new)), strict=True)
        ]
        mixed = Path(new.time, *arrays)
        if 0 < sum(missed) < agents:
            apart.append(smallest_separation(mixed).value)
        if sum(missed) == 1:
            longest.append(longest_edge(mixed, fleet))
    safe = min(apart) >= 0.3 and max(longest) <= 2.5
    if strict_bounds(fleet).keeps_mixed(new, old):
        assert safe
    elif agents == 2:  # then one of the two mixes is bad, whoever it is
        assert not safe


class HastyPlanner:
    """Finds that everyone can fly on faster."""

    def __init__(self, faster):
        self.faster = faster

    def evaluate(self, ocp, x):
        return SCPResult(x, 1.0, 0.0, ())

    def polish(self, ocp, x, iterations, deadline):
        position, velocity = ocp.motion(x)
        return SCPResult(ocp.decision(position[0], self.faster(velocity)), 0.5, 0.0, ())


@pytest.mark.parametrize(("gap", "taken"), [(0.55, False), (1.6, True)])
def test_a_better_plan_is_not_taken_when_whoever_misses_it_is_in_the_way(gap, taken):
    """One behind the other, both as fast: faster together is well, but not if the one in front has not heard of it."""
    agents = [{"id": "a1", "start_m": [0.6, 2.0]}, {"id": "a2", "start_m": [0.6 + gap, 2.0]}]
    mission = small_mission(agents=agents)
    law = RecedingHorizon(mission)
    start, still = mission.fleet.start, np.zeros((2, 2))
    slow = np.zeros((8, 2, 2))
    slow[:4, :, 0] = 0.25
    law._whole = Trajectory.from_velocities(start, still, slow, 0.0, PERIOD)

    def faster(velocity):
        return np.where(np.arange(len(velocity))[:, None, None] == 1, 2.5 * velocity, velocity)

    law._planner = HastyPlanner(faster)
    result = law.step(start, still, 0.0, deadline=None)
    assert result.reason == ("more coverage" if taken else "no better")
    assert (result.plan.velocity[1, 0, 0] > 0.5) == taken


def test_a_mission_in_which_a_third_of_all_plans_is_lost_is_flown_all_the_same():
    mission = small_mission()
    rng = np.random.default_rng(5)
    dropped = []

    def channel(key, payload):
        if key.endswith("/plan") and rng.uniform() < 0.3:
            dropped.append(key)
            return []
        return [payload]

    result = simulate(mission, channel=channel)
    assert len(dropped) > 5
    assert result.complete
    report = check_trajectory(result.trajectory)
    assert report.holds, report.failures
