"""No command overwrites what it finds, unless it is asked to; without --out all of them can be repeated."""

import json

import pytest
import typer
import yaml
from quick_missions import QUICK, write_mission
from tiny_mission import TINY

from mpc_cover.cli import app

RESUMED = {"study horizon", "study robustness", "torture"}
"""These add what is missing to the results of an earlier run of the same study, and refuse everything else."""

WRITES = {
    "demo": (("demo", "q.yaml", "--out", "there"), "there/trajectory.npz"),
    "simulate": (("simulate", "q.yaml", "--out", "there"), "there/trajectory.npz"),
    "serve": (("serve", "q.yaml", "--out", "there"), "there/trajectory.npz"),
    "agent": (("agent", "q.yaml", "--id", "a1", "--record", "there.jsonl"), "there.jsonl"),
    "plan": (("plan", "q.yaml", "--out", "there.npz"), "there.npz"),
    "plot": (("plot", "run", "--out", "there"), "there/overview.png"),
    "bench planner": (("bench", "planner", "t.yaml", "--out", "there"), "there/bench.csv"),
    "size": (("size", "--out", "there"), "there/figure-1.2.png"),
    "keys new": (("keys", "new", "barn", "--agents", "a1", "--out", "there"), "there/a1/key.pem"),
    "study laws": (("study", "laws", "t.yaml", "--out", "there"), "there/laws.json"),
    "study thesis": (("study", "thesis", "--out", "there"), "there/index.html"),
}
"""A command line of each command that writes, and a file that would be lost."""
QUICKLY = {
    "simulate": (),
    "plan": (),
    "plot": (),
    "bench planner": ("--peers", "ours-piqp", "--guess", "rest"),
    "size": ("--seeds", "0"),
    "keys new": (),
}
"""Those that are done in a second or two, with what makes them so."""


@pytest.fixture
def there(tmp_path, simulated):
    """Return a function that puts a file of somebody's, or a run, where a command is going to write."""
    write_mission(tmp_path / "q.yaml", QUICK)
    (tmp_path / "t.yaml").write_text(yaml.safe_dump(TINY))

    def there(name):
        file = tmp_path / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(b"precious")
        if name.endswith("trajectory.npz"):
            (file.parent / "run.json").write_text("{}")
        return file

    return there


def commands(group, *path):
    for name, command in group.commands.items():
        if hasattr(command, "commands"):
            yield from commands(command, *path, name)
        else:
            yield " ".join((*path, name)), {option for each in command.params for option in each.opts}


def test_every_command_that_writes_is_among_these():
    writing = {
        name: options for name, options in commands(typer.main.get_command(app)) if {"--out", "--record"} & options
    }
    assert set(writing) == set(WRITES) | RESUMED
    assert all("--overwrite" in options for name, options in writing.items() if name not in RESUMED)


@pytest.mark.parametrize("name", WRITES)
def test_what_is_there_is_named_and_kept(refused, there, tmp_path, name):
    line, lost = WRITES[name]
    file = there(lost)
    before = sorted(tmp_path.rglob("*"))
    message = refused(*line)
    assert f"{lost} is there already" in message
    assert "--overwrite" in message
    assert file.read_bytes() == b"precious"
    assert [path for path in sorted(tmp_path.rglob("*")) if ".mpc-cover" not in str(path)] == before


@pytest.mark.parametrize("name", QUICKLY)
def test_it_is_overwritten_where_that_is_asked_for(run, there, name):
    line, lost = WRITES[name]
    file = there(lost)
    status, _, err = run(*line, *QUICKLY[name], "--overwrite")
    assert status == 0, err
    assert file.read_bytes() != b"precious"


def test_a_file_that_the_command_does_not_write_is_in_nobodys_way(run, there, tmp_path):
    kept = there("there/notes.txt")
    assert run("size", "--seeds", "0", "--out", "there")[0] == 0
    assert kept.read_bytes() == b"precious"


def test_commands_can_be_repeated_without_an_out(run, there, tmp_path):
    there("q.txt")
    for _ in range(2):
        assert run("plan", "q.yaml")[0] == 0
        assert run("plot", "plan.npz")[0] == 0
        assert run("plot", "run")[0] == 0
        assert run("simulate", "q.yaml")[0] == 0
    assert {"plan.npz", "plan-2.npz", "plan", "plan-2"} <= {path.name for path in tmp_path.iterdir()}
    assert {"plot", "plot-2"} <= {path.name for path in (tmp_path / "run").iterdir()}
    assert len(list((tmp_path / "runs").iterdir())) == 2


def test_a_flight_that_ended_before_it_began_leaves_nothing_to_lose(run, there, tmp_path, monkeypatch):
    there("q.txt")

    def interrupt(*_, **__):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr("mpc_cover.service.run.simulate.simulate", interrupt)
        assert run("simulate", "q.yaml", "--out", "again")[0] == 130
    assert run("simulate", "q.yaml", "--out", "again")[0] == 0


def test_a_folder_of_plans(run, refused, there, tmp_path):
    there("missions/x.txt")
    (tmp_path / "missions" / "tiny.yaml").write_text(yaml.safe_dump(TINY))
    line = ("plan", "--all", "missions", "--starts", "1", "--json")
    first, second = (json.loads(run(*line)[1])["plans"][0]["file"] for _ in range(2))
    assert (first, second) == ("plans/tiny.npz", "plans-2/tiny.npz")
    assert "plans/tiny.npz is there already" in refused(*line[:-1], "--out", "plans")
    assert run(*line, "--out", "plans", "--overwrite")[0] == 0


def test_parts_of_another_seed_are_not_lost(run, refused, tmp_path):
    line = ("study", "thesis", "--only", "1.2", "--jobs", 1, "--out", "t", "--seed")
    assert run(*line, 1)[0] == 0
    assert run(*line, 1)[0] == 0
    assert "part.json is there already" in refused(*line, 2)
    assert run(*line, 2, "--overwrite")[0] == 0
