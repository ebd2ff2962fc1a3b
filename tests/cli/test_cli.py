"""The command line as a whole: help, what is no command line, and that it starts without heavy imports."""

import subprocess
import sys

import pytest

from mpc_cover import __version__


def test_version(run):
    assert run("--version") == (0, f"mpc-cover {__version__}\n", "")


@pytest.mark.parametrize(
    "command",
    [
        (),
        ("demo",),
        ("serve",),
        ("agent",),
        ("retask",),
        ("command",),
        ("router",),
        ("keys", "new"),
        ("simulate",),
        ("plan",),
        ("check",),
        ("plot",),
    ],
)
def test_help(run, command):
    status, out, err = run(*command, "--help")
    assert status == 0
    assert "Usage: mpc-cover" in out
    assert not err


@pytest.mark.parametrize(
    "command",
    [("nonsense",), ("agent", "box-3"), ("check",), ("demo", "--speed", "fast"), ("serve", "box-3", "--sped", "1")],
)
def test_what_is_no_command_line(run, command):
    status, out, err = run(*command)
    assert (status, out) == (2, "")
    assert "Usage: mpc-cover" in err


def test_nothing_heavy_is_imported_by_an_agent(tmp_path):
    heavy = ["scipy", "cvxpy", "matplotlib", "osqp", "clarabel", "piqp", "shapely", "rich"]
    code = (
        "import sys, mpc_cover.cli, mpc_cover.service.run.serve\n"
        "import mpc_cover.service.agent.agent, mpc_cover.service.agent.recorder\n"
        f"mpc_cover.cli.options.load('box-3'); print([name for name in {heavy} if name in sys.modules])"
    )
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=tmp_path)
    assert out.stdout.strip() in ("[]", "['rich']")  # typer brings rich along
