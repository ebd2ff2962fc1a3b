"""The public names of the package: cheap to import, and each a thin way to what the command line does."""

import json
import subprocess
import sys

import numpy as np
import pytest
from tiny_mission import TINY, WIDE

import mpc_cover
from mpc_cover.information.replay import measured_at


@pytest.fixture(scope="module")
def plan():
    return mpc_cover.plan(TINY, starts=2)


@pytest.fixture(scope="module")
def flight():
    return mpc_cover.simulate(TINY, seed=3)


def loaded_by(code):
    """Return which heavy modules a line of code has imported."""
    heavy = ["numpy", "scipy", "pydantic", "cvxpy", "matplotlib", "osqp", "clarabel", "piqp", "zenoh", "rich"]
    report = f"import json, sys; print(json.dumps([name for name in {heavy} if name in sys.modules]))"
    done = subprocess.run([sys.executable, "-c", f"{code}\n{report}"], capture_output=True, text=True, check=True)
    return set(json.loads(done.stdout))


def test_importing_the_package_imports_nothing_and_each_name_no_more_than_it_needs():
    assert loaded_by("import mpc_cover; dir(mpc_cover); mpc_cover.UserError") == set()
    assert loaded_by("import mpc_cover; mpc_cover.load_mission('box-3')") <= {"numpy", "pydantic"}


def test_every_public_name_is_there_and_no_other():
    for name in mpc_cover.__all__:
        assert getattr(mpc_cover, name) is getattr(mpc_cover, name)
    assert set(mpc_cover.__all__) <= set(dir(mpc_cover))
    with pytest.raises(AttributeError, match="no attribute 'nonsense'"):
        _ = mpc_cover.nonsense


def test_a_mission_is_given_by_name_file_keys_or_as_it_is(tmp_path):
    file = tmp_path / "tiny.yaml"
    file.write_text(json.dumps(TINY), encoding="utf-8")
    mission = mpc_cover.load_mission(file)
    assert mpc_cover.load_mission(mission) is mission
    assert mpc_cover.load_mission(TINY).to_json() == mpc_cover.load_mission(str(file)).to_json() == mission.to_json()
    assert mpc_cover.load_mission("box-3").spec.name == "box-3"


def test_weights_of_keys_are_read_like_those_of_a_file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    np.save(tmp_path / "weights.npy", np.array([[1.0, 0.0]]))
    mission = mpc_cover.load_mission({**TINY, "area": {**TINY["area"], "weights": {"file": "weights.npy"}}})
    assert 2 * mission.field.size == mpc_cover.load_mission(TINY).field.size  # cells of weight 0 need no look


def test_a_plan_is_verified_covers_everything_and_is_the_same_every_time(plan):
    assert mpc_cover.check(plan).holds
    assert plan.meta["cost_m"] == 0.0
    assert np.isfinite(plan.covered_at).all()
    again = mpc_cover.plan(mpc_cover.load_mission(TINY), starts=2)
    np.testing.assert_array_equal(again.position, plan.position)


def test_a_flight_is_verified_complete_and_that_of_its_seed(flight):
    assert flight.complete
    assert flight.outcome == "everything is covered and everyone is at rest"
    assert (flight.lost, flight.recording.meta["seed"]) == ((), 3)
    assert mpc_cover.check(flight.recording).holds
    assert flight.step_times.size
    assert (flight.step_times > 0.0).all()


def test_who_dies_is_lost_and_the_others_finish():
    flight = mpc_cover.simulate(WIDE, deaths={"a2": 1.0})
    assert flight.lost == ("a2",)
    assert flight.complete
    assert mpc_cover.check(flight.recording).holds


def test_the_potential_law_flies_the_same_mission_and_solves_no_qp():
    flight = mpc_cover.simulate(WIDE, controller="potential", seed=1)
    assert flight.complete
    assert mpc_cover.check(flight.recording).holds
    with pytest.raises(mpc_cover.UserError, match="solves no QP"):
        mpc_cover.simulate(WIDE, controller="potential", backend="osqp")


def test_a_recording_comes_back_from_its_file_and_from_its_folder(plan, tmp_path):
    file = tmp_path / "trajectory.npz"
    mpc_cover.save_trajectory(plan, file)
    for source in (file, tmp_path, str(file)):
        found = mpc_cover.load_trajectory(source)
        np.testing.assert_array_equal(found.position, plan.position)
        assert found.meta == plan.meta
        assert mpc_cover.check(source).holds
    assert mpc_cover.load_trajectory(plan) is plan


def test_what_does_not_hold_is_in_the_report(plan):
    moved = mpc_cover.Recording(
        plan.time,
        plan.position + 100.0,
        plan.velocity,
        plan.input,
        cell=plan.cell,
        covered_at=measured_at(plan.mission, plan.time, plan.position),
        agent_id=plan.agent_id,
        mission=plan.mission,
    )
    assert not mpc_cover.check(moved).holds


def test_pictures_are_drawn_with_step_times_where_there_are_some(flight, plan, tmp_path):
    names = {path.name for path in mpc_cover.plot(flight.recording, tmp_path / "a", step_times=flight.step_times)}
    assert {"overview.png", "steps.png"} <= names
    drawn = mpc_cover.plot(plan, tmp_path / "b")
    assert "steps.png" not in {path.name for path in drawn}
    assert all(path.stat().st_size for path in drawn)


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: mpc_cover.load_mission("nowhere"), "nowhere: no such file"),
        (lambda: mpc_cover.load_mission({"name": "half"}), "mission half: .* problems"),
        (lambda: mpc_cover.plan(TINY, backend="gurobi"), "gurobi"),
        (lambda: mpc_cover.plan(TINY, seed=-1), "seed: -1: must be at least 0"),
        (lambda: mpc_cover.plan(TINY, starts=0, time_limit_s=0.0), "2 problems(?s:.*)time_limit_s(?s:.*)starts"),
        (lambda: mpc_cover.plan(TINY, time_limit_s=float("nan")), "time_limit_s"),
        (lambda: mpc_cover.plan(TINY, backend="osqp", exact_cones=True), "exact cones: osqp has no"),
        (lambda: mpc_cover.plan(TINY, formulation="cvxpy", extra="nowhere:wish"), "there is no module nowhere"),
        (lambda: mpc_cover.plan(TINY, formulation="cvxpy", extra=3), "extra 3: must be a function, or its name"),
        (lambda: mpc_cover.plan(TINY, extra=print), "needs formulation cvxpy"),
        (lambda: mpc_cover.plan("fig-5-1"), "dynamics single"),
        (lambda: mpc_cover.simulate(TINY, backend="gurobi"), "gurobi"),
        (lambda: mpc_cover.simulate(TINY, controller="pid"), "must be mpc or potential"),
        (lambda: mpc_cover.simulate(TINY, deaths={"a9": 1.0}), "deaths: 'a9@1': there is no a9"),
        (lambda: mpc_cover.plan(3), "mission: 3: must be a name, a file, a mapping or a Mission"),
        (lambda: mpc_cover.simulate(""), "must be a name"),
        (lambda: mpc_cover.check(None), "must be a file, a run folder or a Recording"),
        (lambda: mpc_cover.load_trajectory("none.npz"), "none.npz: cannot be read"),
        (lambda: mpc_cover.check("none.npz"), "none.npz: cannot be read"),
        (lambda: mpc_cover.plot("none.npz", "out"), "none.npz: cannot be read"),
    ],
)
def test_a_mistake_is_a_user_error_that_names_it(call, said, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(mpc_cover.UserError, match=said):
        call()


def test_a_recording_is_judged_by_the_mission_that_is_given():
    flown = mpc_cover.simulate(TINY).recording
    assert mpc_cover.check(flown, mission=TINY).holds
    slower = {**TINY["fleet"], "defaults": {**TINY["fleet"]["defaults"], "speed_max_m_per_s": 0.1}}
    assert "speed" in {check.name for check in mpc_cover.check(flown, mission={**TINY, "fleet": slower}).failures}
    with pytest.raises(mpc_cover.UserError, match=r"agents: .* must be those of mission l-hole"):
        mpc_cover.check(flown, mission="l-hole")
