"""Shared by all tests: Hypothesis without a clock and with a fixed seed, and a way to run a command line."""

from __future__ import annotations

import sys

import pytest
from hypothesis import settings

from mpc_cover import cli

settings.register_profile("repeatable", deadline=None, derandomize=True, database=None)
settings.load_profile("repeatable")


@pytest.fixture
def run(capsys, monkeypatch, tmp_path):
    """Return a function that runs a command line in an empty folder: exit status, stdout, stderr."""
    monkeypatch.chdir(tmp_path)

    def run(*arguments):
        monkeypatch.setattr(sys, "argv", ["mpc-cover", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            cli.main()
        return ended.value.code or 0, *capsys.readouterr()

    return run


@pytest.fixture
def refused(run):
    """Return a function that runs a command line which must be refused; its message."""

    def refused(*arguments):
        status, out, err = run(*arguments)
        assert status == 2
        assert not out
        assert err.startswith("mpc-cover: ")
        assert "Traceback" not in err
        return err

    return refused
