"""The examples run as they stand, and say what they promise."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).parents[1] / "examples"
MOST_LINES = 30

SAID = {
    "add_a_cvxpy_constraint": r"J = (?P<cost>[\d.]+) m, optimal; nobody came nearer than (?P<nearest>[\d.]+) m",
    "plan_a_mission": r"[\d.]+ s, J = 0 m, verified: True; figures in out",
    "plot_a_study": r"4 of 4 runs; coverage-yard\.png, .* in out",
    "simulate_a_death": r"everything is covered, and everyone but a2 .* [\d.]+ s; verified: True; separation: holds.*",
    "swap_the_backend": r"piqp: J = [\d.]+ m .*\nclarabel: J = [\d.]+ m .*\nosqp: J = [\d.]+ m .*",
}


@pytest.fixture
def said(tmp_path):
    """Return a function that runs an example in an empty folder; what it says, matched."""

    def said(name, *arguments):
        command = [sys.executable, str(EXAMPLES / f"{name}.py"), *arguments]
        done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=tmp_path, timeout=120)
        assert (done.returncode, done.stderr) == (0, "")
        found = re.fullmatch(SAID[name], done.stdout.strip())
        assert found, done.stdout
        return found

    return said


def test_all_examples_are_run_and_fit_on_a_screen():
    scripts = {path.stem: path.read_text(encoding="utf-8").splitlines() for path in EXAMPLES.glob("*.py")}
    assert scripts.keys() == SAID.keys()
    assert {name: len(lines) for name, lines in scripts.items() if len(lines) > MOST_LINES} == {}


@pytest.mark.parametrize("name", ["plan_a_mission", "plot_a_study", "simulate_a_death"])
def test_what_draws_does_so_in_the_folder_that_it_is_given(said, tmp_path, name):
    said(name, "out")
    assert list((tmp_path / "out").glob("*.png"))


def test_a_constraint_of_ones_own_holds_and_costs_something(said):
    found = said("add_a_cvxpy_constraint")
    assert float(found["nearest"]) >= 1.0
    assert float(found["cost"]) > 0.0


def test_each_back_end_plans(said):
    said("swap_the_backend")
