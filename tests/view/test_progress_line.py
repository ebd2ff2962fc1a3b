"""The line that a command which lasts shows meanwhile."""

import io
import re

import pytest
from heard import Heard
from rich.console import Console

from mpc_cover.view.progress import PLAIN_EVERY_S, QUIET_S, ProgressLine


class Clock:
    def __init__(self):
        self.now = 100.0

    def __call__(self):
        return self.now


@pytest.fixture
def clock():
    return Clock()


def plain(clock, **options):
    file = io.StringIO()
    return file, ProgressLine(Console(file=file, width=80), monotonic=clock, **options)


def test_what_is_done_at_once_says_nothing(clock):
    file, line = plain(clock)
    with line:
        line.begin("plans box-3")
        clock.now += 0.5 * QUIET_S
        line.show("tries 13 s")
    assert file.getvalue() == ""


def test_plain_lines_are_few_and_say_what_how_long_and_of_how_much(clock):
    file, line = plain(clock)
    with line:
        line.begin("plans box-3", 60.0)
        for _ in range(1000):
            clock.now += 0.01
            line.show("tries 13 s; best so far 14 s")
    lines = file.getvalue().splitlines()
    assert lines[0] == f"plans box-3 ({QUIET_S:.0f} of 60 s): tries 13 s; best so far 14 s"
    assert len(lines) == 1 + int((10.0 - QUIET_S) / PLAIN_EVERY_S)
    assert "\x1b" not in file.getvalue()


def test_time_goes_on_without_news():
    file = Heard("plans box-3", 3)
    with ProgressLine(Console(file=file, width=80), plain_every_s=0.01, quiet_s=0.0) as line:
        line.begin("plans box-3")
        assert file.enough.wait(30.0)


def test_what_is_said_stays_at_once(clock):
    file, line = plain(clock)
    with line:
        line.say("[13 s: covers everything]")
        assert file.getvalue() == "[13 s: covers everything]\n"


@pytest.mark.parametrize(("leave", "left"), [(True, "12 of 12 runs"), (False, "")])
def test_the_newest_is_left_behind_where_that_is_asked_for(clock, leave, left):
    file, line = plain(clock, leave=leave)
    with line:
        line.begin("")
        line.show("1 of 12 runs", 1 / 12)
        line.show("12 of 12 runs", 1.0)
    assert file.getvalue().strip() == left


def test_a_terminal_has_one_line_that_is_renewed(clock):
    file = io.StringIO()
    with ProgressLine(Console(file=file, width=80, force_terminal=True), monotonic=clock) as line:
        line.begin("flies", 20.0)
        clock.now += 7.0
        line.show("nearly", 0.9)
    text = re.sub(r"\x1b\[[0-9;?]*[a-zA-Z]", "", file.getvalue())
    assert "flies (7 of 20 s): nearly" in text
    assert text.count("\n") <= 1, "no line stays"


def test_by_default_it_goes_to_stderr(capsys, clock):
    with ProgressLine(monotonic=clock) as line:
        line.say("something")
    assert capsys.readouterr() == ("", "something\n")
