"""CasADi and IPOPT: the formulation that a researcher would write today, tuned as well as we could.

Chosen by measuring on box-3 from both guesses: MUMPS (it comes along), monotone barrier (neither the adaptive one,
nor a smaller one to begin later stages with, nor a longer memory of L-BFGS was faster), tolerance 1e-4 on the
optimality of a function that is itself an approximation, 1e-6 on constraints.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import casadi as cs

from mpc_cover.studies.peers.nlpsol import ITERATIONS, LONG, SHARPNESS, Viewer, run
from mpc_cover.studies.peers.transcription import Transcription

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray
    from mpc_cover.studies.case import Case
    from mpc_cover.studies.watch import Answer, Watch


def smoothed(case: Case, x: FloatArray, watch: Watch, *, exact_hessian: bool) -> Answer:
    """Solve with log-sum-exp for the minimum, its sharpness raised in stages; L-BFGS or the exact Hessian."""
    transcription = Transcription(case, soft=True)
    viewer = Viewer(transcription, watch)
    extra: dict[str, Any] = {"ipopt.hessian_approximation": "limited-memory"}
    if exact_hessian:
        extra = {"hess_lag": transcription.hessian(upper_triangle=True)}
    short = _solver(transcription, viewer, ITERATIONS, extra)
    stages = [(sharpness, short) for sharpness in SHARPNESS[:-1]]
    stages.append((SHARPNESS[-1], _solver(transcription, viewer, LONG, extra)))
    return run(case, x, watch, transcription, stages, viewer)


def hard(case: Case, x: FloatArray, watch: Watch) -> Answer:
    """Solve with the minimum as it is, although it has kinks: the usual first formulation.

    L-BFGS, as the minimum's second derivative is not what bends J. One stage; the sensing margin is that of the
    sharpest soft minimum.
    """
    transcription = Transcription(case, soft=False)
    viewer = Viewer(transcription, watch)
    solver = _solver(transcription, viewer, LONG, {"ipopt.hessian_approximation": "limited-memory"})
    return run(case, x, watch, transcription, [(SHARPNESS[-1], solver)], viewer)


def _solver(transcription: Transcription, viewer: Viewer, iterations: int, extra: dict[str, Any]) -> Any:
    options = {
        "iteration_callback": viewer,
        "error_on_fail": False,
        "print_time": False,
        "ipopt.print_level": 0,
        "ipopt.sb": "yes",
        "ipopt.max_iter": iterations,
        "ipopt.tol": 1e-4,
        "ipopt.constr_viol_tol": 1e-6,
        **extra,
    }
    return cs.nlpsol("solver", "ipopt", transcription.nlp, options)
