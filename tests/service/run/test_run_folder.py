"""Run folders are told apart, and what is none of ours is told."""

import numpy as np
import pytest

from mpc_cover.errors import UnreadableFileError
from mpc_cover.service.run.run_folder import RunFolder, read_step_times, run_path


def test_runs_of_the_same_second_do_not_collide(tmp_path, monkeypatch, mission):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("time.strftime", lambda _: "20250101-000000")
    names = []
    for _ in range(3):
        folder = run_path(None, mission)
        RunFolder(folder, "demo", mission)
        names.append(folder.name)
    assert names == ["small-20250101-000000", "small-20250101-000000-2", "small-20250101-000000-3"]


def test_step_times_that_are_none(tmp_path):
    assert read_step_times(tmp_path) is None
    np.savez(tmp_path / "step_times.npz", step_time=np.array([0.1, np.nan]))
    with pytest.raises(UnreadableFileError, match="finite"):
        read_step_times(tmp_path)
