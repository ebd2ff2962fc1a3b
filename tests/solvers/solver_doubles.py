"""Stand-ins: a clock, and a back-end that answers what it was told to."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np

from solvers.backends.base import Backend, RawSolution
from solvers.backends.capabilities import Capabilities
from solvers.status import Status

if TYPE_CHECKING:
    from collections.abc import Callable

    from solvers.backends.options import Options
    from solvers.qp import QP


class FakeClock:
    """Seconds that pass only by `pass_s`, and by `step_s` at every look."""

    def __init__(self, step_s: float = 0.0) -> None:
        self.time_s = 0.0
        self.step_s = step_s

    def __call__(self) -> float:
        self.time_s += self.step_s
        return self.time_s

    def pass_s(self, seconds: float) -> None:
        self.time_s += seconds


class ScriptedBackend(Backend):
    """Each solve takes the next answer: a RawSolution, or an exception to raise; likewise each set-up."""

    name: ClassVar[str] = "scripted"
    capabilities: ClassVar[Capabilities] = Capabilities(
        second_order_cones=False, inexact=1e-3, fine=1e-4, accurate=1e-6, entry_iteration_s=1e-8
    )

    def __init__(
        self,
        *answers: RawSolution | BaseException,
        clock: Callable[[], float] | None = None,
        setups: list[BaseException | None] | None = None,
    ) -> None:
        super().__init__(clock or FakeClock())
        self.answers = list(answers)
        self.setups = setups or []
        self.calls: list[str] = []
        self.limits: list[float | None] = []

    def _setup(self, _qp: QP, _options: Options) -> None:
        self.calls.append("setup")
        if self.setups and (error := self.setups.pop(0)) is not None:
            raise error

    def _update(self, _qp: QP, changed: frozenset[str]) -> bool:
        self.calls.append("update " + " ".join(sorted(changed)))
        return True

    def _warm_start(self, _x: np.ndarray, _y: np.ndarray | None) -> bool:
        self.calls.append("warm_start")
        return True

    def _solve(self, left_s: float | None) -> RawSolution:
        self.calls.append("solve")
        self.limits.append(left_s)
        answer = self.answers.pop(0)
        if isinstance(answer, BaseException):
            raise answer
        return answer


def raw(x: list[float], y: list[float], status: Status = Status.SOLVED) -> RawSolution:
    return RawSolution(np.array(x), np.array(y), status, 1, status.name)
