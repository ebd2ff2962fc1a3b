"""The exit statuses of all commands, as the README has them."""

import pytest

from mpc_cover.exit_status import ExitStatus, exit_status


@pytest.mark.parametrize(
    ("given", "status"),
    [
        ({}, 0),
        ({"holds": False}, 1),
        ({"covered": False}, 1),
        ({"holds": False, "covered": False}, 1),
        ({"interrupted": True}, 130),
        ({"holds": False, "covered": False, "interrupted": True}, 130),
    ],
)
def test_the_exit_status_of_an_outcome(given, status):
    assert exit_status(**given) == status


def test_a_mistake_is_told_from_a_failure():
    assert (ExitStatus.WELL, ExitStatus.UNFULFILLED, ExitStatus.MISTAKE, ExitStatus.INTERRUPTED) == (0, 1, 2, 130)
