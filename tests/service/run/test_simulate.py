"""The closed loop in one process gives the same result every time."""

import numpy as np
import pytest
from sweep_laws import StraightSweepLaw

from mpc_cover.service.run.simulate import simulate
from mpc_cover.trajectory_file import load_trajectory, save_trajectory
from mpc_cover.verification.check import check_trajectory


def test_it_flies_the_mission_and_what_it_flew_holds(mission):
    statuses = []
    result = simulate(mission, law=StraightSweepLaw(mission), on_tick=statuses.append)
    assert result.complete
    assert check_trajectory(result.trajectory).holds
    assert np.isfinite(result.trajectory.covered_at).all()
    assert statuses[-1].covered_count == mission.field.size
    assert statuses[-1].steps == sum(step.kind == "step" for step in result.steps) > 0
    assert result.events[-1] == "controller: everything is covered and everyone is at rest"


@pytest.mark.parametrize("backend", ["piqp", "clarabel", "osqp"])
def test_the_real_thing_gives_the_same_bytes_twice(mission, tmp_path, backend):
    files = []
    for number in range(2):
        result = simulate(mission, backend=backend, seed=3)
        assert result.complete
        files.append(tmp_path / f"{number}.npz")
        save_trajectory(result.trajectory, files[-1])
    assert files[0].read_bytes() == files[1].read_bytes()
    again = load_trajectory(files[0])
    assert again.meta == {"kind": "simulate", "version": again.meta["version"], "seed": 3, "backend": backend}
    assert check_trajectory(again).holds


def test_a_mission_that_runs_out_of_time_is_not_complete(mission):
    law = StraightSweepLaw(mission, goal_y=1.5)
    law.mission = mission
    control = mission.spec.control.model_copy(update={"time_limit_s": 3.0})
    short = type(mission)(mission.spec.model_copy(update={"control": control}), mission.field, mission.fleet)
    result = simulate(short, law=law)
    assert not result.complete
    assert check_trajectory(result.trajectory).holds
