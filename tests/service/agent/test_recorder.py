"""An agent's own record: each piece of its motion is on the disk at once, and what is no record is told."""

import numpy as np
import pytest
from service_fakes import straight_plan

from mpc_cover.errors import UnreadableFileError, UserError
from mpc_cover.service.agent.recorder import FileRecorder, Header, MemoryRecorder, read_record


@pytest.fixture
def flown(bench, agent, send):
    """Return the pieces of a flight along one plan."""
    send(straight_plan(agent, 100.5))
    bench.run(seconds=5.0)
    agent.shutdown()
    return bench.records["a1"].pieces


@pytest.fixture
def file(tmp_path, flown):
    path = tmp_path / "a1.jsonl"
    recorder = FileRecorder(path, Header("a1", "life", "small"), print)
    for piece in flown[:-1]:
        recorder.piece(
            piece.time_s, np.array(piece.position), np.array(piece.velocity), np.array(piece.input), piece.plan
        )
    last = flown[-1]
    recorder.close(last.time_s, np.array(last.position), np.array(last.velocity))
    return path


def test_what_is_written_is_read(file, flown):
    header, pieces = read_record(file)
    assert (header.agent, header.instance) == ("a1", "life")
    assert pieces == flown


def test_a_torn_last_line_is_dropped(file, flown):
    data = file.read_bytes()
    file.write_bytes(data[:-7])
    assert read_record(file)[1] == flown[:-1]


@pytest.mark.parametrize(
    "content", [b"", b"junk\njunk\n", b'{"agent":"a1"}\n', b'{"agent":"a","instance":"i","mission":"m"}\n[1]\n']
)
def test_what_is_no_record_is_told(tmp_path, content):
    path = tmp_path / "a1.jsonl"
    path.write_bytes(content)
    with pytest.raises(UnreadableFileError, match="is not an agent's record"):
        read_record(path)


def test_a_missing_record_is_told(tmp_path):
    with pytest.raises(UnreadableFileError, match="cannot be read"):
        read_record(tmp_path / "none.jsonl")


def test_a_record_that_cannot_be_begun_is_told(tmp_path):
    with pytest.raises(UserError, match="cannot be written"):
        FileRecorder(tmp_path / "no" / "a1.jsonl", Header("a1", "life", "small"), print)


def test_a_full_disk_ends_the_record_but_not_the_agent():
    said = []
    recorder = FileRecorder(Full(), Header("a1", "life", "small"), said.append)
    for _ in range(3):
        recorder.piece(0.0, np.zeros(2), np.zeros(2), np.zeros(2), None)
    recorder.close(1.0, np.zeros(2), np.zeros(2))
    assert len(said) == 1
    assert "No space left on device" in said[0]


class Full:
    """A file of a disk that is full after the header."""

    def __init__(self):
        self.lines = 0

    def open(self, _mode, *, buffering):
        assert buffering == 0
        return self

    def write(self, _data):
        self.lines += 1
        if self.lines > 1:
            raise OSError(28, "No space left on device")

    def close(self):
        pass


def test_a_recorder_in_memory_keeps_the_plan_flown():
    recorder = MemoryRecorder()
    recorder.piece(0.0, np.zeros(2), np.zeros(2), np.ones(2), None)
    assert recorder.pieces[0].input == [1.0, 1.0]
