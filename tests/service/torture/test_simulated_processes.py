"""Processes on virtual time: killed, stopped, continued, slow, with clocks of their own."""

import pytest
from ticking import started

from mpc_cover.errors import UserError
from mpc_cover.service.torture.processes import Process
from mpc_cover.service.torture.virtual_time import VirtualTime


def run(time: VirtualTime, until_s: float) -> None:
    time.run(until_s, lambda: False)


def test_it_ticks_when_its_ticks_are_due_whatever_the_origin_and_the_rate_of_its_clock():
    time = VirtualTime()
    _, plain = started(time)
    _, shifted = started(time, origin_s=98765.4321)
    _, fast = started(time, rate=2.0)
    run(time, 3.2)
    assert plain.ticks == [0.0, 1.0, 2.0, 3.0]
    assert shifted.ticks == pytest.approx(plain.ticks, abs=1e-6)
    assert fast.ticks == [0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0]


def test_work_takes_virtual_time_and_others_run_meanwhile():
    time = VirtualTime()
    _, slow = started(time, work_s=0.7)
    _, other = started(time)
    run(time, 2.0)
    assert slow.ticks == [0.7, 1.7]
    assert other.ticks == [0.0, 1.0, 2.0]


def test_a_killed_process_does_nothing_more_also_in_the_middle_of_a_tick():
    time = VirtualTime()
    process, participant = started(time, work_s=0.7)
    time.at(1.3, process.kill)
    run(time, 5.0)
    assert participant.ticks == [0.7]
    assert not participant.ended
    assert not process.alive
    assert not process.ended


def test_a_stopped_process_does_what_waited_for_it_once_it_is_continued():
    time, heard = VirtualTime(), []
    process, participant = started(time)
    time.at(1.5, process.stop)
    time.at(2.5, lambda: process.when_running(lambda: heard.append(time.now_s)))
    time.at(4.25, process.proceed)
    run(time, 6.0)
    assert heard == [4.25]
    assert participant.ticks[:3] == [0.0, 1.0, 4.25]
    assert participant.ticks[-1] == 6.0


def test_a_slow_process_is_late_by_no_more_than_its_lag():
    time = VirtualTime()
    process, participant = started(time, seed="7")
    process.lag_s = 0.4
    run(time, 20.0)
    late = [tick - round(tick - 0.2) for tick in participant.ticks[1:]]
    assert all(-1e-9 <= each <= 0.4 + 1e-9 for each in late)
    assert max(late) > 0.1


def test_what_ends_it_is_kept_as_a_crash_and_what_keeps_it_from_starting_as_a_reason():
    time = VirtualTime()

    class Broken:
        done = False
        next_time = 1.0

        def startup(self) -> None:
            pass

        def tick(self) -> None:
            raise ValueError("a bug")

        def shutdown(self) -> None:
            pass

    def unable() -> Broken:
        raise UserError("no room")

    broken, refused = Process("broken", time, 0.0), Process("refused", time, 0.0)
    broken.start(Broken)
    refused.start(unable)
    run(time, 2.0)
    assert "ValueError: a bug" in broken.crash
    assert not broken.alive
    assert refused.unable == "no room"
    assert not refused.crash


def test_steps_of_the_wall_clock_leave_the_monotonic_clock_alone():
    time = VirtualTime()
    process, participant = started(time)
    time.at(1.5, lambda: setattr(process.clock, "step_s", -3600.0))
    run(time, 3.0)
    assert participant.ticks == [0.0, 1.0, 2.0, 3.0]
    assert participant.wall_steps_s == [0.0, 0.0, -3600.0, -3600.0]
