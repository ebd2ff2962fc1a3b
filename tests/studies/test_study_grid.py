"""Which runs a study has, and what is refused before the first."""

import json
from dataclasses import replace

import pytest
import yaml
from study_fixtures import TINY, tiny, tiny_run

from mpc_cover.errors import UserError
from mpc_cover.studies.grid import Grid, runs_of, steps_of


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "tiny.yaml"
    path.write_text(yaml.safe_dump(TINY))
    return str(path)


@pytest.fixture
def grid(file):
    return Grid(missions=(file,), horizons=("6", "4s"), seeds=2, controllers=("mpc", "sweep"))


def test_every_combination_is_a_run_and_the_first_seed_comes_first(grid):
    runs = runs_of(grid).runs
    assert [(run.controller, run.horizon_steps, run.backend, run.seed) for run in runs] == [
        ("mpc", 6, "native", 0),
        ("mpc", 8, "native", 0),
        ("sweep", None, None, 0),
        ("mpc", 6, "native", 1),
        ("mpc", 8, "native", 1),
        ("sweep", None, None, 1),
    ]
    assert len({run.key for run in runs}) == 6


def test_what_is_given_twice_is_flown_once(grid, file):
    twice = replace(grid, missions=(file, file), horizons=("8", "4s"), controllers=("mpc", "mpc"), periods=(0.5, 0.5))
    assert len(runs_of(twice).runs) == 2


def test_keys_tell_runs_apart_and_nothing_else():
    run = tiny_run()
    assert run.key == tiny_run().key
    others = [{"seed": 1}, {"horizon_steps": 9}, {"period_s": 0.4}, {"backend": "osqp"}, {"starts": "mission"}]
    assert len({run.key, *(replace(run, **other).key for other in others)}) == 6


def test_a_run_builds_its_mission():
    built = tiny_run(period_s=0.25, horizon_steps=12, seed=7).build()
    assert built.spec.control.period_s == 0.25
    assert built.spec.control.horizon_steps == 12
    assert built.fleet.start.tolist() != tiny().fleet.start.tolist()
    assert tiny_run(starts="mission").build().fleet.start.tolist() == tiny().fleet.start.tolist()
    assert built.field.size == tiny().field.size


def test_without_a_horizon_the_missions_own_lasts_as_long():
    assert tiny_run("sweep", period_s=0.3).build().spec.control.horizon_steps == 14


def test_random_starts_do_not_have_to_reach_the_ends_of_offline_plans():
    ends = [{**agent, "end_m": agent["start_m"]} for agent in TINY["fleet"]["agents"]]
    mission = tiny(fleet={"agents": ends}, planning={"duration_s": 1.0, "end": "fixed"})
    for seed in range(5):
        assert tiny_run(mission=mission, seed=seed).build().spec.planning.end == "rest"


def test_horizons_are_steps_or_seconds():
    assert [steps_of("24", 0.5), steps_of("12s", 0.5), steps_of("12 s", 0.5), steps_of("1s", 0.3)] == [24, 24, 24, 4]


@pytest.mark.parametrize("horizon", ["0", "-3", "x", "1.5", "s", "nans", "infs", "0s", "1e999s"])
def test_a_horizon_that_is_none_is_refused(horizon):
    with pytest.raises(UserError, match=r"--horizons .*: must be a number of steps, as 24, or of seconds, as 12s"):
        steps_of(horizon, 0.5)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"seeds": 0}, "--seeds 0: must be at least 1"),
        ({"seeds": -1}, "--seeds -1: must be at least 1"),
        ({"horizons": ()}, "--horizons: is empty"),
        ({"missions": ()}, "MISSION: is empty"),
        ({"backends": ()}, "--backends: is empty"),
        ({"controllers": ()}, "--controllers: is empty"),
        ({"controllers": ("mpc", "pid")}, "--controllers pid: is none: must be among mpc, sweep, potential"),
        ({"backends": ("gurobi",)}, "--backends gurobi: is none: must be among native, osqp, clarabel, piqp"),
        ({"periods": (0.0,)}, "--periods 0: must be a number of seconds"),
        ({"periods": (float("nan"),)}, "--periods nan: must be a number of seconds"),
        ({"starts": "anywhere"}, "--starts anywhere: must be one of random, mission"),
        ({"missions": ("no-such",)}, "mission no-such: no such file"),
        ({"horizons": ("8", "3")}, r"mission tiny with a horizon of 3 steps \(1.5 s\).*\n.*brakes in 2 steps"),
        ({"horizons": ("401",)}, r"a horizon of 401 steps"),
        ({"periods": (0.05,)}, r"control.state_period_s: 0.1: must be at most period_s 0.05"),
    ],
)
def test_mistakes_are_told_before_anything_flies(grid, changes, message):
    with pytest.raises(UserError, match=message):
        runs_of(replace(grid, **changes))


def test_two_missions_of_one_name_are_refused(grid, file, tmp_path):
    other = tmp_path / "other.yaml"
    other.write_text(yaml.safe_dump({**TINY, "control": {"horizon_steps": 9}}))
    with pytest.raises(UserError, match="two of them are called tiny"):
        runs_of(replace(grid, missions=(file, str(other))))


def test_a_fleet_that_the_potential_law_cannot_keep_apart_is_refused(grid, tmp_path):
    deaf = tmp_path / "deaf.yaml"
    deaf.write_text(json.dumps({**TINY, "fleet": {**TINY["fleet"], "communication_range_m": 1.6}}))
    with pytest.raises(UserError, match=r"mission tiny: potential: communication range 1\.6 m"):
        runs_of(replace(grid, missions=(str(deaf),), controllers=("potential",)))


def test_seeds_that_change_nothing_are_remarked_upon(grid):
    assert runs_of(grid).remarks == []
    assert "tiny: start alike and are not disturbed" in runs_of(replace(grid, starts="mission")).remarks[0]
