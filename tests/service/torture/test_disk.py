"""The disk: full for a time, and torn by a death."""

import pytest

from mpc_cover.service.controller.state_directory import StateDirectory, StateError, write_durably
from mpc_cover.service.torture.disk import Disk
from mpc_cover.service.torture.faults import Fault, FaultKind


def test_a_full_disk_takes_no_checkpoint_and_no_epoch_and_keeps_what_it_has(tmp_path):
    disk = Disk(tmp_path, [], "1")
    with StateDirectory(tmp_path) as folder:
        assert folder.next_epoch()[0] == 1
        write_durably(tmp_path / "coverage.0", b"old")
        disk.fill(full=True)
        with pytest.raises(OSError, match="directory"):
            write_durably(tmp_path / "coverage.0", b"new")
        with pytest.raises(StateError):
            folder.next_epoch()
        assert (tmp_path / "coverage.0").read_bytes() == b"old"
        disk.fill(full=False)
        write_durably(tmp_path / "coverage.0", b"new")
        assert folder.next_epoch()[0] == 2
    assert (tmp_path / "coverage.0").read_bytes() == b"new"


def test_a_death_tears_the_newest_checkpoint_where_a_fault_says_so(tmp_path):
    fault = Fault(FaultKind.DISK, 1.0, 2.0, way="torn")
    (tmp_path / "coverage.0").write_bytes(b"x" * 100)
    Disk(tmp_path, [fault], "1").crash(4.0)
    assert (tmp_path / "coverage.0").stat().st_size == 100
    Disk(tmp_path, [fault], "1").crash(2.0)
    assert (tmp_path / "coverage.0").stat().st_size < 100
