"""Executors of a study's runs: processes of this machine (joblib), or an existing Dask cluster."""

from __future__ import annotations

import asyncio
import signal
from contextlib import closing
from typing import TYPE_CHECKING, Any, Protocol, Self, TypeVar

from mpc_cover.errors import UserError
from mpc_cover.studies.measure import failed

if TYPE_CHECKING:
    from collections.abc import Callable, Generator, Sequence
    from types import TracebackType

    from mpc_cover.studies.measure import Fly
    from mpc_cover.studies.record import Record
    from mpc_cover.studies.runs import Run

R = TypeVar("R")
"""A run."""
D = TypeVar("D")
"""What is known of a run that is done."""
CONNECT_S = 10.0
"""How long to wait for a cluster [s]."""
_KEPT = "what is finished is kept, and the same command goes on from there"


class Executor(Protocol):
    """A context manager that flies runs, and yields their records as they are finished, in any order."""

    def __enter__(self) -> Self:
        """Acquire the workers."""
        ...

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Release the workers."""
        ...

    def fly(self, runs: Sequence[Run], fly: Fly) -> Generator[Record]:
        """Fly the runs by calling `fly` on each in a worker."""
        ...


class LocalExecutor:
    """`jobs` processes of this machine, each with one thread; with one job, this process."""

    def __init__(self, jobs: int) -> None:
        self._jobs = jobs

    def __enter__(self) -> Self:
        """Do nothing: processes start with the first runs."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Do nothing: processes end with the last run."""

    def fly(self, runs: Sequence[R], fly: Callable[[R], D]) -> Generator[D]:
        """Fly the runs.

        Raises
        ------
        UserError
            A process was killed.
        """
        if min(self._jobs, len(runs)) <= 1:
            yield from map(fly, runs)
            return
        import joblib  # noqa: PLC0415 - only here
        from joblib.externals.loky.process_executor import TerminatedWorkerError  # noqa: PLC0415 - likewise

        tasks = (joblib.delayed(_undisturbed)(fly, run) for run in runs)
        with joblib.parallel_config("loky", n_jobs=self._jobs, inner_max_num_threads=1):
            parallel = joblib.Parallel(return_as="generator_unordered", batch_size=1)
        try:
            with closing(parallel(tasks)) as records:
                yield from records
        except TerminatedWorkerError:
            why = "a process of the study was killed, perhaps for want of memory, of which fewer --jobs need less"
            raise UserError(f"{why}: {_KEPT}") from None


def _undisturbed(fly: Callable[[R], D], run: R) -> D:
    """Fly in a process of its own, which leaves Ctrl-C to the parent."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    return fly(run)


class DaskExecutor:
    """An existing Dask cluster, on whose workers mpc-cover is installed."""

    def __init__(self, address: str, timeout_s: float = CONNECT_S) -> None:
        self._address, self._timeout_s = address, timeout_s
        self._client: Any = None

    def __enter__(self) -> Self:
        """Connect.

        Raises
        ------
        UserError
            Dask is not installed, or there is no scheduler at the address.
        """
        try:
            import distributed  # noqa: PLC0415 - an extra
            from distributed.comm import connect  # noqa: PLC0415 - likewise
        except ImportError:
            raise UserError("--dask: Dask is not installed: pip install 'mpc-cover[dask]'") from None

        async def probe() -> None:  # a client without a scheduler would log many errors
            await (await connect(self._address, timeout=self._timeout_s)).close()

        try:
            asyncio.run(probe())
            self._client = distributed.Client(self._address, timeout=self._timeout_s, set_as_default=False)
        except (OSError, ValueError, TimeoutError, TypeError) as error:
            text = " ".join(str(error).split())
            raise UserError(f"--dask {self._address}: no Dask scheduler answers there: {text}") from None
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Disconnect; the cluster stays as it is."""
        self._client.close()

    def fly(self, runs: Sequence[Run], fly: Fly) -> Generator[Record]:
        """Fly the runs; one that the cluster loses is returned as one that broke off.

        Raises
        ------
        UserError
            The whole cluster is lost.
        """
        import distributed  # noqa: PLC0415 - an extra

        waiting = {self._client.submit(fly, run, pure=False): run for run in runs}
        try:
            for future in distributed.as_completed(list(waiting), loop=self._client.loop):
                if future.cancelled():
                    raise UserError(f"--dask {self._address}: the cluster went away: {_KEPT}")
                run, error = waiting.pop(future), future.exception()
                yield future.result() if error is None else failed(run, error)
        finally:
            self._client.cancel(list(waiting))
