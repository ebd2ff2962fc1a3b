"""The small parts: signals, the loop, the grid, the step log, the run folder, what is shown."""

import io
import os
import signal
import socket
from threading import Event

import numpy as np
import pytest
from rich.console import Console

from mpc_cover.clock import VirtualClock
from mpc_cover.errors import UnreadableFileError, UserError
from mpc_cover.service.controller.mission_clock import MissionClock
from mpc_cover.service.controller.step_log import Step, StepLog, read_steps
from mpc_cover.service.protocol.bus import RequestError
from mpc_cover.service.protocol.local import LocalBus
from mpc_cover.service.protocol.messages import Phase, Status
from mpc_cover.service.run import processes
from mpc_cover.service.run.daemon import Signals, run
from mpc_cover.service.run.processes import free_port
from mpc_cover.service.run.progress import Progress, describe
from mpc_cover.service.run.run_folder import RunFolder, default_folder, read_step_times

STEP = Step("step", 1.5, 0.02, 0.025, "NEW", "replanned", deadline_missed=True)


@pytest.mark.parametrize(("number", "status"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_signal_stops_and_a_second_ctrl_c_interrupts(number, status):
    before = signal.getsignal(number)
    with Signals() as signals:
        assert signals.exit_status == 0
        os.kill(os.getpid(), number)
        assert signals.stop.wait(5.0)
        assert signals.exit_status == status
        with pytest.raises(KeyboardInterrupt):
            os.kill(os.getpid(), signal.SIGINT)
        assert signals.exit_status == status
    assert signal.getsignal(number) is before


class Counted:
    """Ticks three times, a second apart."""

    def __init__(self):
        self.calls = []

    @property
    def next_time(self):
        return float(self.calls.count("tick"))

    @property
    def done(self):
        return self.calls.count("tick") == 3

    def startup(self):
        self.calls.append("startup")

    def tick(self):
        self.calls.append("tick")

    def shutdown(self):
        self.calls.append("shutdown")


def test_the_loop_ticks_until_done():
    participant, clock = Counted(), VirtualClock()
    run(participant, clock, Event())
    assert participant.calls == ["startup", "tick", "tick", "tick", "shutdown"]
    assert clock.now() == 2.0


def test_the_loop_ends_with_a_signal_and_shuts_down_whatever_happens():
    participant, stop = Counted(), Event()
    stop.set()
    run(participant, VirtualClock(), stop)
    assert participant.calls == ["startup", "shutdown"]
    with pytest.raises(ZeroDivisionError):
        run(participant, VirtualClock(), Event(), after_tick=lambda: 1 / 0)
    assert participant.calls[-1] == "shutdown"


def test_the_grid_is_never_rebased():
    clock = VirtualClock(1e6)
    mission_clock = MissionClock(clock, 0.1)
    mission_clock.start(1e6 + 0.1)
    due = []
    for late in (0.0, 0.03, 0.31, 0.0, 0.1, 0.0):
        mission_clock.next_tick()
        due.append(mission_clock.due_s)
        clock.wait_until(mission_clock.due_s + late, Event())
    ticks = (np.array(due) - 1e6) / 0.1
    np.testing.assert_allclose(ticks, [1, 2, 3, 6, 7, 8], atol=1e-6)


def test_mission_time_stands_still_while_paused():
    clock = VirtualClock(50.0)
    mission_clock = MissionClock(clock, 0.5, mission_time_s=7.0)
    clock.wait_until(60.0, Event())
    assert mission_clock.now() == 7.0
    mission_clock.start(61.0)
    assert mission_clock.now() == 7.0
    clock.wait_until(63.0, Event())
    assert mission_clock.now() == 9.0
    assert mission_clock.origin_s == 54.0
    mission_clock.pause()
    clock.wait_until(70.0, Event())
    assert mission_clock.now() == 9.0
    mission_clock.resume(40.0)
    assert mission_clock.now() == 30.0


def test_a_step_log_is_read_back_without_its_torn_line(tmp_path):
    path = tmp_path / "steps.jsonl"
    for _ in range(2):  # a second controller appends
        log = StepLog(path)
        log.add(STEP)
        log.close()
    assert (log.count, log.misses, log.last) == (1, 1, STEP)
    assert read_steps(path) == [STEP, STEP]
    path.write_bytes(path.read_bytes()[:-3])
    assert read_steps(path) == [STEP]
    path.write_bytes(b"junk\n")
    with pytest.raises(UnreadableFileError):
        read_steps(path)
    assert read_steps(tmp_path / "none") == []
    with pytest.raises(UserError, match="cannot be written"):
        StepLog(tmp_path / "no" / "steps.jsonl")


def test_a_step_log_on_a_full_disk_does_not_stop_the_control():
    class Full:
        def open(self, *_, **__):
            return self

        def write(self, _):
            raise OSError(28, "No space left on device")

        def close(self):
            pass

    log = StepLog(Full())
    log.add(STEP)
    log.add(STEP)
    assert log.count == 2


def status(covered: int, phase: Phase = Phase.FLYING) -> Status:
    return Status(
        controller="c", epoch=1, seq=0, phase=phase, mission_time_s=1.0, covered_count=covered, cell_count=10_000
    )


def test_what_is_not_complete_is_never_shown_as_100():
    assert "100.0 %" in describe(status(10_000))
    assert " 99.9 %" in describe(status(9_999))


@pytest.mark.parametrize("terminal", [True, False])
def test_progress_leaves_the_last_line_behind(terminal):
    console = Console(force_terminal=terminal, record=True, width=100, file=(sink := open(os.devnull, "w")))  # noqa: PTH123, SIM115
    with sink, Progress(console) as progress:
        for covered in (0, 5_000, 9_999):
            progress.show(status(covered))
        progress.say("[not markup]")
    text = console.export_text()
    assert "[not markup]" in text
    assert text.rstrip().endswith(describe(status(9_999)))


class Heard(io.StringIO):
    """A file that tells when a text was written to it so many times."""

    def __init__(self, text, times):
        super().__init__()
        self.text, self.times, self.enough = text, times, Event()

    def write(self, part):
        size = super().write(part)
        if self.getvalue().count(self.text) >= self.times:
            self.enough.set()
        return size


def test_planning_is_not_silent_while_nothing_is_heard_of_it():
    file = Heard("s so far", 3)
    with Progress(Console(file=file, width=100), plans_every_s=0.01) as progress:
        progress.show(status(0, Phase.PLANNING))  # and nothing more, until it is done
        assert file.enough.wait(30.0)
        progress.show(status(9_999))
        said = file.getvalue().count("s so far")
    lines = file.getvalue().splitlines()
    assert lines[0] == "plans while everyone is at rest: 0 s so far"
    assert lines[-1] == describe(status(9_999))
    assert len(lines) == said + 1


def test_runs_of_the_same_second_do_not_collide(tmp_path, monkeypatch, mission):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("time.strftime", lambda _: "20250101-000000")
    names = []
    for _ in range(3):
        folder = default_folder(mission)
        RunFolder(folder, "demo", mission)
        names.append(folder.name)
    assert names == ["small-20250101-000000", "small-20250101-000000-2", "small-20250101-000000-3"]


def test_step_times_that_are_none(tmp_path):
    assert read_step_times(tmp_path) is None
    np.savez(tmp_path / "step_times.npz", step_time=np.array([0.1, np.nan]))
    with pytest.raises(UnreadableFileError, match="finite"):
        read_step_times(tmp_path)


def test_a_free_port_is_one(monkeypatch):
    port = free_port()
    assert free_port([port]) != port
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", port))
        monkeypatch.setattr(processes, "PORTS", range(port, port + 1))
        with pytest.raises(UserError, match="no port"):
            free_port()


def test_a_bus_in_memory_cannot_wait():
    with pytest.raises(RequestError):
        LocalBus(VirtualClock()).join().ask("key", b"", 1.0)
