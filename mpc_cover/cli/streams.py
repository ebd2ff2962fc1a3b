"""Standard streams that may break: a closed pipe or a full disk ends what is printed, and nothing else."""

from __future__ import annotations

import errno
import os
import sys
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Any, TextIO, cast

if TYPE_CHECKING:
    from collections.abc import Iterator


class GuardedStream:
    """A text stream whose write errors are kept; after the first one what is written is dropped.

    Attributes
    ----------
    error : the first write error, None as long as there was none.
    """

    def __init__(self, stream: TextIO) -> None:
        self.error: OSError | None = None
        self._stream = stream

    def __getattr__(self, name: str) -> Any:
        """Return an attribute of the stream."""
        return getattr(self._stream, name)

    def write(self, text: str) -> int:
        """Write, or drop the text."""
        try:
            return self._stream.write(text)
        except OSError as error:
            self._break(error)
            return len(text)

    def flush(self) -> None:
        """Flush, or drop what was buffered."""
        try:
            self._stream.flush()
        except OSError as error:
            self._break(error)

    def _break(self, error: OSError) -> None:
        """Let the stream's file be the null device from now on, so that what is buffered can be flushed at the end."""
        self.error = self.error or error
        with suppress(OSError, ValueError):
            null = os.open(os.devnull, os.O_WRONLY)
            os.dup2(null, self._stream.fileno())
            os.close(null)


@contextmanager
def guarded_streams() -> Iterator[GuardedStream]:
    """Guard standard output, which is returned, and standard error."""
    before = sys.stdout, sys.stderr
    out = GuardedStream(sys.stdout)
    sys.stdout, sys.stderr = cast("TextIO", out), cast("TextIO", GuardedStream(sys.stderr))
    try:
        yield out
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        sys.stdout, sys.stderr = before


def lost_output(out: GuardedStream) -> str | None:
    """Return why output was lost, in words; None where nothing was, or a reader has closed its pipe on purpose."""
    out.flush()
    if out.error is None or out.error.errno == errno.EPIPE:
        return None
    return f"standard output: cannot be written: {out.error.strerror}"
