"""The command line, one file per command; a user's mistake is one message and exit status 2."""

from __future__ import annotations

import os
import sys
from typing import Annotated

import typer

from mpc_cover.cli import (
    agent,
    bench,
    check,
    command,
    demo,
    keys,
    plan,
    plot,
    retask,
    router,
    serve,
    simulate,
    size,
    study,
    torture,
)
from mpc_cover.cli.options import print_json
from mpc_cover.cli.streams import guarded_streams, lost_output
from mpc_cover.errors import UserError, problems_of
from mpc_cover.exit_status import ExitStatus

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
"""Our matrices are small: more threads only get in each other's way (set before numpy is imported)."""

app = typer.Typer(
    name="mpc-cover",
    help="Receding-horizon area coverage by a fleet of mobile sensors.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _version(wanted: bool) -> None:
    if wanted:
        from mpc_cover.version import __version__  # noqa: PLC0415 - every import here is one that agents need not wait for

        typer.echo(f"mpc-cover {__version__}")
        raise typer.Exit


@app.callback()
def _root(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """Receding-horizon area coverage by a fleet of mobile sensors."""


app.command()(demo.demo)
app.command()(simulate.simulate)
app.command()(plan.plan)
app.command()(check.check)
app.command()(plot.plot)
app.command()(serve.serve)
app.command()(agent.agent)
app.command()(retask.retask)
app.command()(command.command)
app.command()(router.router)
app.command()(size.size)
app.command()(torture.torture)
app.add_typer(bench.app)
app.add_typer(study.app)
app.add_typer(keys.app)


def main() -> None:
    """Run the command line, and exit; output that cannot be written ends no command."""
    with guarded_streams() as out:
        status = _run()
        if (lost := lost_output(out)) is not None:
            sys.stderr.write(f"mpc-cover: {lost}\n")
            status = status or ExitStatus.UNFULFILLED
    sys.exit(status)


def _run() -> int:
    """Run the command line; return the exit status."""
    try:
        app(prog_name="mpc-cover")
    except SystemExit as ended:
        return ended.code if isinstance(ended.code, int) else int(ended.code is not None)
    except UserError as error:
        sys.stderr.write(f"mpc-cover: {error}\n")
        if "--json" in sys.argv:
            print_json({"error": str(error), "problems": problems_of(error), "exit_status": int(ExitStatus.MISTAKE)})
        return ExitStatus.MISTAKE
    except KeyboardInterrupt:
        return ExitStatus.INTERRUPTED
    return ExitStatus.WELL
