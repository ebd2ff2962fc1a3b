"""`mpc-cover check` and `mpc-cover plot`: violations, and files that are no trajectory."""

import json

import numpy as np
import pytest


def test_check_says_what_holds(simulated, run):
    for path in ("run", "run/trajectory.npz"):
        status, out, err = run("check", path)
        assert (status, "mpc-cover:" in err) == (0, False)
        assert "separation" in out
    status, out, err = run("check", "run", "--json")
    assert status == 0
    assert json.loads(out)["holds"]
    assert "separation" in err


def test_check_finds_a_violation(simulated, run, tmp_path):
    damage(tmp_path / "run" / "trajectory.npz", input=lambda a: a * 1.5)
    status, out, _ = run("check", "run", "--json")
    assert status == 1
    assert not json.loads(out)["holds"]


def damage(file, **changes):
    with np.load(file) as archive:
        arrays = {name: archive[name] for name in archive.files}
    for name, change in changes.items():
        arrays[name] = change(arrays[name])
    np.savez(file, **arrays)


def nan(array):
    array[1, 0, 0] = np.nan
    return array


@pytest.mark.parametrize("command", ["check", "plot"])
def test_a_bad_trajectory(simulated, refused, tmp_path, command):
    file = tmp_path / "run" / "trajectory.npz"
    whole = file.read_bytes()
    for length in (0, 10, len(whole) // 2, len(whole) - 1):
        file.write_bytes(whole[:length])
        assert "cannot be read" in refused(command, file)
        assert "cannot be read" in refused(command, "run")
    file.write_bytes(whole)
    damage(file, position=nan)
    assert "position[1, 0, 0]: nan: must be finite" in refused(command, file)
    assert "cannot be read" in refused(command, "none.npz")
    (tmp_path / "empty").mkdir()
    assert "cannot be read" in refused(command, "empty")


def test_bad_step_times(simulated, refused, tmp_path):
    (tmp_path / "run" / "step_times.npz").write_bytes(b"junk")
    assert "step times" in refused("plot", "run")


def test_check_says_by_which_mission_it_judges(simulated, run, refused, tmp_path):
    _, out, _ = run("check", "run")
    assert "judged as a flight by the mission that the file holds, " in out
    assert "differs" not in out
    mission = json.loads((tmp_path / "run" / "mission.json").read_text())
    (tmp_path / "mine.json").write_text(json.dumps(mission))
    status, out, _ = run("check", "run", "--mission", "mine.json")
    assert (status, "judged as a flight by mission mine.json" in out, "differs" in out) == (0, True, False)
    mission["fleet"]["separation_min_m"] *= 1.5
    (tmp_path / "mine.json").write_text(json.dumps(mission))
    _, out, _ = run("check", "run", "--mission", "mine.json")
    assert "the mission in the file differs: fleet.separation_min_m: " in out
    _, out, _ = run("check", "run", "--mission", "mine.json", "--json")
    judged = json.loads(out)["judged_by"]
    assert judged["mission"] == "mine.json"
    assert [text.split(":")[0] for text in judged["differences"]] == ["fleet.separation_min_m"]
    (tmp_path / "run" / "mission.json").write_text(json.dumps(mission))
    _, out, _ = run("check", "run")
    assert "differs in fleet.separation_min_m: --mission judges by that one" in out


def test_check_refuses_a_mission_of_other_agents(simulated, refused, tmp_path):
    said = refused("check", "run", "--mission", "l-hole")
    assert "agents: " in said
    assert "must be those of mission l-hole: ['a1', 'a2', 'a3', 'a4']" in said
    assert "no such file" in refused("check", "run", "--mission", "nowhere")
