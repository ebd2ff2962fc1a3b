"""The closed loop in one process gives the same result every time, and flies nothing that is not safe."""

import json

import numpy as np
import pytest
from service_fakes import small_mission
from sweep_laws import FAULTS, FaultyLaw, StraightSweepLaw

from mpc_cover.planning.budget import Budget
from mpc_cover.service.protocol.decoding import decode_plan
from mpc_cover.service.run import simulate as simulation
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


def test_a_mission_that_runs_out_of_time_is_not_complete():
    mission = small_mission(time_limit_s=3.0)
    result = simulate(mission, law=StraightSweepLaw(mission, goal_y=1.5))
    assert not result.complete
    assert check_trajectory(result.trajectory).holds


@pytest.mark.parametrize("first", [0, 3], ids=["at rest", "in flight"])
@pytest.mark.parametrize("fault", FAULTS)
def test_a_faulty_plan_is_neither_sent_nor_flown(fault, first):
    """It ends with three plans refused, wherever the fleet then is at rest."""
    mission, sent = small_mission(height=9.0), []

    def channel(key, payload):
        if key.endswith("/plan"):
            sent.append(decode_plan(payload, 2))
        return [payload]

    law = FaultyLaw(mission, fault, first, goal_y=8.5)
    result = simulate(mission, law=law, channel=channel)
    assert not result.complete
    assert result.outcome == "the safety filter refused 3 plans in a row"
    assert any(FAULTS[fault][1] in event for event in result.events)
    assert len(law.sent) == first
    for plan, good in zip(sent, np.repeat(law.good, 2), strict=True):
        np.testing.assert_array_equal(plan.input, good.input[:, mission.fleet.ids.index(plan.agent)])
    assert not np.abs(result.trajectory.velocity[-1]).max() > 1e-9
    assert check_trajectory(result.trajectory).holds
    if first == 0:
        assert not result.trajectory.velocity.any()


def test_the_command_says_that_plans_were_refused_and_ends_with_status_1(run, monkeypatch, tmp_path):
    mission = small_mission(height=9.0)
    (tmp_path / "mission.yaml").write_text(mission.to_json())
    monkeypatch.setattr(simulation, "make_control_law", lambda mission, *_: FaultyLaw(mission, "a collision"))
    status, out, err = run("simulate", "mission.yaml", "--out", "r", "--json")
    assert status == 1
    assert "the safety filter refused 3 plans in a row" in err
    assert "Traceback" not in err
    summary = json.loads(out)
    assert not summary["complete"]
    assert summary["outcome"] == "the safety filter refused 3 plans in a row"
    status, out, err = run("check", "r")
    assert (status, err) == (1, "")  # they stayed where they were, in good order, and covered next to nothing


def test_whether_work_or_time_is_counted_makes_no_difference_to_a_law_in_time(monkeypatch):
    """Simulations have deadlines, too; only the clock is another."""
    mission = small_mission(disturbance={"input_noise_m_per_s2": 0.02, "delay_s": 0.1})
    flights = []
    for kind in ("counted", "wall_clock", "unlimited"):
        law = StraightSweepLaw(mission)
        with monkeypatch.context() as patch:
            of = {"unlimited": lambda _seconds: Budget.unlimited()}.get(kind, getattr(Budget, kind))
            patch.setattr(Budget, "counted", of)
            result = simulate(mission, law=law, seed=2)
        assert result.complete
        decided = [(state.time, state.position.tobytes()) for state in law.states]
        flights.append((result.trajectory.position.tobytes(), result.trajectory.time.tobytes(), decided))
    assert flights[0] == flights[1] == flights[2]


def test_each_plan_has_the_budget_that_a_controller_in_flight_gives_it(mission):
    law, control = StraightSweepLaw(mission), mission.spec.control
    simulate(mission, law=law)
    assert law.budgets_s[0] == control.planning_time_s
    np.testing.assert_allclose(law.budgets_s[1:], control.deadline_fraction * control.period_s, atol=1e-9)
