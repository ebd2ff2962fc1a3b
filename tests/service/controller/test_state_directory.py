"""A controller's folder: one controller at a time, and epochs that only grow."""

import subprocess
import sys

import pytest

from mpc_cover.service.controller.state_directory import StateDirectory, StateError


def test_epochs_only_grow(tmp_path):
    for epoch in (1, 2, 3):
        with StateDirectory(tmp_path) as folder:
            assert folder.next_epoch() == epoch


@pytest.mark.parametrize("content", ["", "seven", "\xff"])
def test_a_damaged_counter_is_no_guess(tmp_path, content):
    (tmp_path / "epoch").write_text(content, encoding="utf-8")
    with StateDirectory(tmp_path) as folder, pytest.raises(StateError, match="is damaged"):
        folder.next_epoch()


def test_a_second_controller_is_told_of_the_first(tmp_path):
    with StateDirectory(tmp_path), pytest.raises(StateError, match="another controller uses it"):
        StateDirectory(tmp_path)


def test_a_killed_holder_lets_go_of_the_lock(tmp_path):
    code = (
        "import sys; from pathlib import Path\n"
        "from mpc_cover.service.controller.state_directory import StateDirectory\n"
        "held = StateDirectory(Path(sys.argv[1])); print('held', flush=True); sys.stdin.read()"
    )
    with subprocess.Popen(
        [sys.executable, "-c", code, str(tmp_path)], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as holder:
        assert holder.stdout.readline() == b"held\n"
        with pytest.raises(StateError):
            StateDirectory(tmp_path)
        holder.kill()
        holder.wait()
        StateDirectory(tmp_path).close()


def test_a_place_that_cannot_be_one(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(StateError, match="cannot be used"):
        StateDirectory(tmp_path / "file" / "state")
