"""A controller's folder: one controller at a time, and epochs that only grow."""

import stat
import subprocess
import sys

import pytest

from mpc_cover.service.controller.state_directory import StateDirectory, StateError


def test_epochs_only_grow(tmp_path):
    for epoch in (1, 2, 3):
        with StateDirectory(tmp_path) as folder:
            assert folder.next_epoch() == (epoch, "")


@pytest.mark.parametrize("content", [b"", b"seven", b"\xff", b"12", b"-3\n", b"9" * 40 + b"\n"])
def test_a_damaged_counter_goes_on_after_the_checkpoints(tmp_path, content):
    """One without its end of line is torn: it may have been a longer number."""
    (tmp_path / "epoch").write_bytes(content)
    with StateDirectory(tmp_path) as folder:
        epoch, text = folder.next_epoch(41)
        assert epoch == 42
        assert "is damaged: goes on after epoch 41, that of the checkpoints" in text
        assert folder.next_epoch(41) == (43, "")


def test_torn_anywhere_it_is_no_lower_than_before(tmp_path):
    with StateDirectory(tmp_path) as folder:
        folder.set_epoch(1234)
        whole = (tmp_path / "epoch").read_bytes()
        for length in range(len(whole)):
            (tmp_path / "epoch").write_bytes(whole[:length])
            assert folder.next_epoch(1234)[0] == 1235


def test_a_missing_counter_beside_checkpoints_goes_on_after_them(tmp_path):
    with StateDirectory(tmp_path) as folder:
        epoch, text = folder.next_epoch(7)
        assert epoch == 8
        assert "is missing: goes on after epoch 7" in text


def test_one_that_was_set_back_does_not_go_back_behind_the_checkpoints(tmp_path):
    with StateDirectory(tmp_path) as folder:
        folder.set_epoch(3)
        epoch, text = folder.next_epoch(7)
        assert epoch == 8
        assert "says 3: goes on after epoch 7" in text


def test_a_secret_is_made_once_and_only_its_owner_may_read_it(tmp_path):
    with StateDirectory(tmp_path) as folder:
        secret = folder.secret()
        assert len(secret) == 32
        assert stat.S_IMODE((tmp_path / "secret").stat().st_mode) == 0o600
        assert folder.secret() == secret
    with StateDirectory(tmp_path) as folder:
        assert folder.secret() == secret
    with StateDirectory(tmp_path / "other") as folder:
        assert folder.secret() != secret


def test_a_secret_that_others_may_read_is_none(tmp_path):
    with StateDirectory(tmp_path) as folder:
        folder.secret()
        (tmp_path / "secret").chmod(0o640)
        with pytest.raises(StateError, match="nobody else may read it: chmod 600"):
            folder.secret()


def test_a_secret_elsewhere_is_none(tmp_path):
    (tmp_path / "elsewhere").write_text("00" * 32)
    (tmp_path / "state").mkdir()
    (tmp_path / "state" / "secret").symlink_to(tmp_path / "elsewhere")
    with StateDirectory(tmp_path / "state") as folder, pytest.raises(StateError, match="secret: cannot be used"):
        folder.secret()


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
