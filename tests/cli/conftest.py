import json
import shutil
import subprocess
import sys

import pytest
import yaml
from quick_missions import QUICK, write_mission
from tiny_mission import WIDE


@pytest.fixture
def mission(tmp_path):
    """Return a function that writes a mission with mistakes."""
    return lambda **changes: write_mission(tmp_path / "mission.yaml", changes)


@pytest.fixture
def quick(mission):
    return mission(**QUICK)


@pytest.fixture
def tiny(tmp_path):
    """A mission that both laws fly, in the folder in which commands run."""
    (tmp_path / "tiny.yaml").write_text(yaml.safe_dump(WIDE))
    return "tiny.yaml"


@pytest.fixture(scope="session")
def made(tmp_path_factory):
    """One run, made once: its folder, its mission, and what was printed."""
    folder = tmp_path_factory.mktemp("made")
    write_mission(folder / "mission.yaml", QUICK)
    command = [sys.executable, "-m", "mpc_cover", "simulate", "mission.yaml", "--out", "run", "--json"]
    out = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True).stdout
    return folder, json.loads(out)


@pytest.fixture
def simulated(made, tmp_path):
    """The run in a folder of the test's own; what was printed."""
    shutil.copytree(made[0], tmp_path, dirs_exist_ok=True)
    return made[1]
