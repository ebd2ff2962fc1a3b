"""`mpc-cover torture` from the outside: tables, replays, folders, and mistakes."""

import json

import pytest
import yaml

MISSION = {
    "schema": 1,
    "name": "small",
    "area": {"shape": {"kind": "box", "min_m": [0.0, 0.0], "max_m": [3.0, 4.0]}, "cell_size_m": 0.5},
    "fleet": {
        "defaults": {"sensing_radius_m": 1.0, "input_max_m_per_s2": 1.0, "speed_max_m_per_s": 1.0},
        "agents": [{"id": "a1", "start_m": [0.75, 0.5]}, {"id": "a2", "start_m": [2.25, 0.5]}],
        "separation_min_m": 0.5,
        "communication_range_m": 3.0,
    },
    "control": {"period_s": 0.5, "horizon_steps": 8, "planning_time_s": 1.0},
}


@pytest.fixture
def mission(tmp_path):
    file = tmp_path / "small.yaml"
    file.write_text(yaml.safe_dump(MISSION), encoding="utf-8")
    return file


def test_it_flies_seeds_tells_of_them_and_goes_on_where_it_was(run, mission, tmp_path):
    common = ("torture", mission, "--faults", "duplicates,clocks", "--jobs", 1, "--out", tmp_path / "t", "--json")
    status, out, err = run(*common, "--seeds", 2)
    first = json.loads(out)
    assert status == 0
    assert (first["flown"], first["finished"], first["violating"]) == (2, 2, [])
    assert "flights by kind of fault" in err
    kept = {file.name: file.stat().st_mtime_ns for file in (tmp_path / "t" / "seeds").iterdir()}
    status, out, _ = run(*common, "--seeds", 3)
    more = json.loads(out)
    assert (status, more["flown"]) == (0, 3)
    assert more["records"][:2] == first["records"]
    assert all((tmp_path / "t" / "seeds" / name).stat().st_mtime_ns == at for name, at in kept.items())


def test_a_seed_is_replayed_into_a_run_folder_that_check_reads(run, mission, tmp_path):
    arguments = ("torture", mission, "--faults", "loss", "--seed", 3, "--json")
    status, out, err = run(*arguments, "--out", tmp_path / "seed-3")
    again = json.loads(run(*arguments)[1])
    assert status == 0, err
    assert json.loads(out)["digest"] == again["digest"]
    assert "loss of everyone" in err
    assert run("check", tmp_path / "seed-3")[0] == 0
    assert "flying" in (tmp_path / "seed-3" / "logs" / "events.log").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--faults", "plague"), "--faults plague: is none: must be among all, loss, bursts"),
        (("--faults", ","), "--faults: is empty"),
        (("--backend", "gurobi"), "--backend gurobi: is none"),
        (("--out", "other"), "--out other: is not empty and not a torture of mpc-cover"),
        (("--seed", 1, "--out", "other"), "run folder other: is not empty and not a run"),
    ],
)
def test_mistakes_are_told_before_anything_is_flown(refused, mission, tmp_path, arguments, message):
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "mine.txt").write_text("mine", encoding="utf-8")
    assert message in refused("torture", mission, *arguments)


def test_results_of_another_torture_are_not_mixed_with_these_unless_they_are_to_be_overwritten(run, refused, mission):
    assert run("torture", mission, "--faults", "clocks", "--seeds", 1, "--jobs", 1, "--out", "t")[0] == 0
    other = ("torture", mission, "--faults", "duplicates", "--seeds", 1, "--jobs", 1, "--out", "t")
    assert "holds flights of another torture (kinds)" in refused(*other)
    assert run(*other, "--overwrite")[0] == 0
