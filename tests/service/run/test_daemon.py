"""Signals, and the loop that every daemon runs."""

import os
import signal
from threading import Event

import pytest

from mpc_cover.clock import VirtualClock
from mpc_cover.service.run.daemon import Signals, run


@pytest.mark.parametrize(("number", "status"), [(signal.SIGINT, 130), (signal.SIGTERM, 0)])
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


def test_a_child_of_a_demo_tells_an_end_by_sigterm_from_one_of_its_own():
    with Signals(child=True) as signals:
        os.kill(os.getpid(), signal.SIGTERM)
        assert signals.stop.wait(5.0)
    assert signals.exit_status == 143


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
