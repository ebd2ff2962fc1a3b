"""Running a CasADi solver through a continuation, with a view of its iterates."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import casadi as cs
import numpy as np

from mpc_cover.planning.scp import length_scale, softness_at

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mpc_cover.arrays import FloatArray
    from mpc_cover.studies.case import Case
    from mpc_cover.studies.peers.transcription import Transcription
    from mpc_cover.studies.watch import Answer, Watch

SHARPNESS = (4.0, 8.0, 20.0, 40.0)
"""beta times the sensing radius, stage by stage. On box-3 a start at 2 took longer, and single stages ended higher."""
ITERATIONS = 60
"""Bound on all stages but the last: fewer left cells behind, more were spent on a minimum that is not the goal."""
LONG = 3000
"""Bound on the last stage: the time limit comes first."""


class Viewer(cs.Callback):  # type: ignore[misc]
    """Hands the iterates of a CasADi solver to the watch, and stops the solver when it is enough."""

    def __init__(self, transcription: Transcription, watch: Watch) -> None:
        cs.Callback.__init__(self)
        self._transcription, self._watch = transcription, watch
        self._sizes = {"x": transcription.nlp["x"].shape[0], "g": transcription.nlp["g"].shape[0], "p": 2, "f": 1}
        self.count = 0
        self.failure: Exception | None = None
        self.construct("viewer", {})

    def get_n_in(self) -> int:
        """Return the number of inputs: all that a solver returns."""
        return int(cs.nlpsol_n_out())

    def get_n_out(self) -> int:
        """Return the number of outputs: whether to stop."""
        return 1

    def get_sparsity_in(self, index: int) -> Any:
        """Return the shape of an input."""
        size = self._sizes[str(cs.nlpsol_out(index)).removeprefix("lam_")]
        return cs.Sparsity.dense(size, 1)

    def eval(self, arguments: Sequence[Any]) -> list[int]:
        """Pass on an iterate; an exception must not propagate into C++ and is kept for `run`."""
        self.count += 1
        try:
            w = np.asarray(arguments[0], dtype=float).ravel()
            return [int(self._watch.see(self._transcription.unpack(w)))]
        except Exception as error:  # noqa: BLE001 - whatever it is, it is raised again outside
            self.failure = error
            return [1]


def run(
    case: Case,
    x: FloatArray,
    watch: Watch,
    transcription: Transcription,
    stages: Sequence[tuple[float, Any]],
    viewer: Viewer,
) -> Answer:
    """Solve stage by stage, each from the result of the one before.

    `stages` are sharpnesses, each with the solver that was built for it. Soft minimum and sensing margin of a stage
    are those of our own continuation.
    """
    watch.begin(x)
    scale, status = length_scale(case.ocp), "nothing to do"
    for sharpness, solver in stages:
        if watch.enough:
            break
        softness = softness_at(sharpness, scale)
        lower, upper = transcription.row_bounds(x)
        found = solver(
            x0=transcription.pack(x),
            p=[softness.beta, softness.margin],
            lbx=transcription.lower,
            ubx=transcription.upper,
            lbg=lower,
            ubg=upper,
        )
        if viewer.failure is not None:
            raise viewer.failure
        x = transcription.unpack(np.asarray(found["x"], dtype=float).ravel())
        status = _status(solver)
    words = "everything is covered" if watch.complete else "time is up" if watch.enough else status
    return watch.answer(x, viewer.count, words)


def _status(solver: Any) -> str:
    try:
        return str(solver.stats()["return_status"])
    except Exception:  # noqa: BLE001 - some plugins leave no status, and say so with a RuntimeError
        return "no status"
