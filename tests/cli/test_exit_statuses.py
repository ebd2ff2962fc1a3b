"""What is left uncovered is exit status 1, whatever the command; so is what does not hold."""

import json

from quick_missions import QUICK, write_mission


def test_a_plan_too_short_to_cover_everything_and_its_check(run, tmp_path):
    write_mission(tmp_path / "short.yaml", {**QUICK, "planning": {"duration_s": 1.5}})
    status, out, _ = run("plan", "short.yaml", "--out", "short.npz", "--starts", "1", "--time-limit", "0.5")
    assert status == 1
    assert "written to short.npz" in out
    assert run("check", "short.npz")[0] == 1


def test_a_flight_that_covers_everything_and_its_check(simulated, run):
    assert simulated["complete"]
    assert run("check", "run")[0] == 0


def test_a_mistake_is_an_object_for_machines_too(run, mission):
    mission(**{**QUICK, "control": {"period_s": -1.0}})
    status, out, err = run("simulate", "mission.yaml", "--json")
    assert status == 2
    told = json.loads(out)
    assert told["exit_status"] == 2
    assert [problem["path"] for problem in told["problems"]] == ["control.period_s"]
    assert told["error"] in err
