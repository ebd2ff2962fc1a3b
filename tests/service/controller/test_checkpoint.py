"""A successor finds what was covered, whatever happened to the disk."""

import numpy as np
import pytest
from service_fakes import small_mission

from mpc_cover.service.controller import state_directory
from mpc_cover.service.controller.checkpoint import FileCheckpoints
from mpc_cover.service.controller.checkpoint_format import flaw_of, pack, unpack
from mpc_cover.service.controller.snapshot import Snapshot
from mpc_cover.service.controller.state_directory import StateDirectory


def snapshot(mission, mission_time_s=1.0, **fields):
    first = np.full((1, mission.field.size), np.inf)
    first[0, : int(mission_time_s)] = 0.5
    return Snapshot(mission_time_s, {"first": first}, **fields)


@pytest.fixture
def folder(tmp_path):
    with StateDirectory(tmp_path / "state") as folder:
        yield folder


SECRET = b"known to the owner of the folder"


def checkpoints(folder, mission, **options):
    return FileCheckpoints(folder, mission, **options)


def test_what_is_kept_is_found(folder, mission):
    kept = snapshot(mission, 7.25, origins={"a1-life": 93.5}, lost={"a2": [1.25, 0.5]}, heard={"a1-life": 71})
    assert checkpoints(folder, mission).save(kept, now=True) is None
    found, text = checkpoints(folder, mission).load()
    assert (found.mission_time_s, found.finished, found.origins) == (7.25, False, {"a1-life": 93.5})
    assert found.lost == {"a2": [1.25, 0.5]}
    assert found.heard == {"a1-life": 71}
    np.testing.assert_array_equal(found.map["first"], kept.map["first"])
    assert "goes on from the checkpoint at mission time 7.2 s" in text or "7.3 s" in text


def test_nothing_kept_nothing_said(folder, mission):
    assert checkpoints(folder, mission).load() == (None, "")


def test_torn_anywhere_the_older_one_is_found(folder, mission):
    """At every byte."""
    writer = checkpoints(folder, mission)
    for time_s in (1.0, 2.0):
        writer.save(snapshot(mission, time_s), now=True)
    newest = max(folder.path.glob("coverage.*"), key=lambda path: unpack(path.read_bytes(), folder.secret())[1])
    data = newest.read_bytes()
    for length in range(len(data)):
        newest.write_bytes(data[:length])
        assert checkpoints(folder, mission).load()[0].mission_time_s == 1.0
    newest.write_bytes(data)
    assert checkpoints(folder, mission).load()[0].mission_time_s == 2.0


def test_a_flipped_bit_anywhere_is_seen(mission):
    data = pack(snapshot(mission), "hash", 3, SECRET)
    assert unpack(data, SECRET) is not None
    for index in range(len(data)):
        assert unpack(data[:index] + bytes([data[index] ^ 1]) + data[index + 1 :], SECRET) is None


def test_when_both_are_damaged_it_starts_afresh_and_says_so(folder, mission):
    writer = checkpoints(folder, mission)
    for time_s in (1.0, 2.0):
        writer.save(snapshot(mission, time_s), now=True)
    for path in folder.path.glob("coverage.*"):
        path.write_bytes(b"\0" * 100)
    assert checkpoints(folder, mission).load() == (None, "no checkpoint is readable: starts afresh")


def test_generations_go_on_after_a_restart(folder, mission):
    for time_s in (1.0, 2.0, 3.0):
        checkpoints(folder, mission).save(snapshot(mission, time_s), now=True)
        assert checkpoints(folder, mission).load()[0].mission_time_s == time_s


def test_another_version_whose_time_is_up_starts_afresh(folder, mission):
    checkpoints(folder, mission).save(snapshot(mission, 7.0), now=True)
    found, text = checkpoints(folder, small_mission(time_limit_s=5.0)).load()
    assert found is None
    assert "another version of this mission" in text
    assert "starts afresh (control.time_limit_s 5 is over)" in text


def test_a_finished_mission_starts_afresh_and_says_so(folder, mission):
    checkpoints(folder, mission).save(snapshot(mission, finished=True), now=True)
    assert checkpoints(folder, mission).load() == (None, "the mission was finished: starts afresh")


def test_it_is_written_once_a_second(folder, mission):
    now = 0.0
    writer = checkpoints(folder, mission, monotonic=lambda: now)
    for now in (10.0, 10.5, 10.9, 11.0, 11.5):
        writer.save(snapshot(mission, now), now=False)
    assert checkpoints(folder, mission).load()[0].mission_time_s == 11.0


def test_a_disk_that_is_full_is_told_and_the_older_one_stays(folder, mission, monkeypatch):
    writer = checkpoints(folder, mission)
    writer.save(snapshot(mission, 1.0), now=True)

    def full(_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(state_directory.os, "fsync", full)
    problem = writer.save(snapshot(mission, 2.0), now=True)
    assert problem == "the checkpoint cannot be written: No space left on device; control goes on"
    monkeypatch.undo()
    assert checkpoints(folder, mission).load()[0].mission_time_s == 1.0
    assert writer.save(snapshot(mission, 3.0), now=True) is None
    assert checkpoints(folder, mission).load()[0].mission_time_s == 3.0


def test_of_another_version_for_the_same_fleet_what_still_holds_is_kept(folder):
    mission, other = small_mission(height=6.0), small_mission()  # smaller, in fact: its box must not grow
    kept = snapshot(mission, 7.0, origins={"a1-life": 93.5})
    checkpoints(folder, mission).save(kept, now=True)
    store = checkpoints(folder, other)
    found, text = store.load()
    assert "another version of this mission: goes on at mission time 7.0 s with what still holds of it" in text
    assert found.map["first"].shape == (1, other.field.size)
    seen = np.isfinite(kept.map["first"][0])
    cells = {tuple(cell) for cell in other.field.cell[np.isfinite(found.map["first"][0])].round(6)}
    both = {tuple(cell) for cell in other.field.cell.round(6)}
    assert cells == {tuple(cell) for cell in mission.field.cell[seen].round(6)} & both
    assert store.versions == found.versions
    assert len(found.versions) == 1
    assert found.origins == kept.origins
    assert store.save(found, now=True) is None
    assert checkpoints(folder, other).load()[0].mission_time_s == 7.0


def test_a_mission_that_was_finished_goes_on_with_what_is_new_of_another_version(folder, mission):
    checkpoints(folder, mission).save(snapshot(mission, 9.0, finished=True), now=True)
    assert checkpoints(folder, mission).load()[0] is None
    found, _ = checkpoints(folder, small_mission(height=6.0)).load()
    assert not found.finished


def test_agents_of_another_version_are_known_only_if_they_may_fly_this_one(folder, mission):
    """What was measured holds all the same."""
    checkpoints(folder, mission).save(snapshot(mission, 3.0), now=True)
    store = checkpoints(folder, small_mission(reach=2.0))
    found, _ = store.load()
    assert np.isfinite(found.map["first"]).sum() == 3
    assert store.versions == []


def forged(data, secret):
    """Return a checkpoint that says that everything is covered, its checksum anew, its MAC by another secret."""
    mission, generation, kept = unpack(data, secret)
    everything = Snapshot(kept.mission_time_s, {name: np.zeros_like(array) for name, array in kept.map.items()})
    return pack(everything, mission, generation + 1, b"of somebody else, who guesses it")


def newest_of(folder):
    return max(folder.path.glob("coverage.*"), key=lambda path: unpack(path.read_bytes(), folder.secret())[1])


def test_a_rewritten_one_that_says_that_all_is_covered_is_not_believed(folder, mission):
    writer = checkpoints(folder, mission)
    for time_s in (1.0, 2.0):
        writer.save(snapshot(mission, time_s), now=True)
    newest = newest_of(folder)
    newest.write_bytes(forged(newest.read_bytes(), folder.secret()))
    found, text = checkpoints(folder, mission).load()
    assert found.mission_time_s == 1.0
    assert np.isinf(found.map["first"]).any()
    assert text.startswith(f"checkpoint {newest} is not authentic: somebody without the secret of this folder wrote it")
    assert text.endswith("it is not used; goes on from the checkpoint at mission time 1.0 s")


def test_when_all_are_forged_it_starts_afresh(folder, mission):
    checkpoints(folder, mission).save(snapshot(mission, 1.0), now=True)
    newest = newest_of(folder)
    newest.write_bytes(forged(newest.read_bytes(), folder.secret()))
    found, text = checkpoints(folder, mission).load()
    assert found is None
    assert "is not authentic" in text
    assert text.endswith("starts afresh")


def test_one_without_a_mac_is_refused_and_so_is_that_of_another_folder(mission):
    data = pack(snapshot(mission), "hash", 3, SECRET)
    head, payload = data.split(b"\n", 1)
    assert "bears no authentication" in flaw_of(head.split(b" ")[0] + b"\n" + payload, SECRET)
    assert "is not authentic" in flaw_of(data, b"the secret of some other folder.")
    assert flaw_of(data, SECRET) == ""


def test_without_its_secret_a_folder_starts_afresh_and_goes_on_under_a_new_one(folder, mission):
    checkpoints(folder, mission).save(snapshot(mission, 1.0), now=True)
    whole = (folder.path / "secret").read_bytes()
    for torn in (b"", whole[:10], whole[:-3], b"\xff" * 65):
        (folder.path / "secret").write_bytes(torn)
        assert checkpoints(folder, mission).load()[0] is None
        checkpoints(folder, mission).save(snapshot(mission, 2.0), now=True)
        assert checkpoints(folder, mission).load()[0].mission_time_s == 2.0


def test_the_file_of_an_earlier_version_of_the_mission_is_vouched_for_too(folder):
    mission, other = small_mission(height=6.0), small_mission()
    checkpoints(folder, mission).save(snapshot(mission, 7.0), now=True)
    file = next(folder.path.glob("mission.*.json"))
    file.write_bytes(file.read_bytes().replace(b'"cell_size_m":0.5', b'"cell_size_m":0.25'))
    found, text = checkpoints(folder, other).load()
    assert found is None
    assert "another version of this mission, whose file is damaged: starts afresh" in text


def test_it_knows_the_highest_epoch_of_those_who_wrote_it(folder, mission):
    assert checkpoints(folder, mission).epoch == 0
    for epoch in (4, 6, 5):
        checkpoints(folder, mission).save(snapshot(mission, 1.0, epoch=epoch), now=True)
    assert checkpoints(folder, mission).epoch == 6
