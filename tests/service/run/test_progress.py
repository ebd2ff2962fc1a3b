"""What a person sees of a flight."""

import os

import pytest
from heard import Heard
from rich.console import Console

from mpc_cover.service.protocol.messages import Phase, Status
from mpc_cover.service.run.progress import Progress, describe


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


def test_planning_is_not_silent_while_nothing_is_heard_of_it():
    file = Heard("plans while", 3)
    with Progress(Console(file=file, width=100), plain_every_s=0.01, quiet_s=0.0) as progress:
        progress.show(status(0, Phase.PLANNING))  # and nothing more, until it is done
        assert file.enough.wait(30.0)
        progress.show(status(9_999))
    lines = file.getvalue().splitlines()
    assert lines[0] == "plans while everyone is at rest (0 s)"
    assert lines[-1] == describe(status(9_999))
