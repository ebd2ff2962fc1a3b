"""`mpc-cover`, and `python -m mpc_cover`: signals are handled before anything is imported that takes its time."""

from __future__ import annotations

import os
import signal
import sys
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from types import FrameType

_DAEMONS = {"serve", "agent", "router"}
"""Commands for which SIGTERM is a clean end, from their first moment on."""


def main() -> None:
    """Run the command line; the entry point of `mpc-cover`."""
    signal.signal(signal.SIGINT, _interrupt)
    if len(sys.argv) > 1 and sys.argv[1] in _DAEMONS and "--with-parent" not in sys.argv:
        signal.signal(signal.SIGTERM, _end)
    from mpc_cover.cli import main as run  # noqa: PLC0415 - only now

    signal.signal(signal.SIGINT, signal.default_int_handler)
    run()


def _interrupt(number: int, frame: FrameType | None) -> None:  # noqa: ARG001 - the signal module's signature
    os._exit(128 + signal.SIGINT)


def _end(number: int, frame: FrameType | None) -> None:  # noqa: ARG001 - likewise
    os._exit(0)


if __name__ == "__main__":
    main()
