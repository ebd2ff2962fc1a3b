"""CasADi's own SQP, with the best of the QP solvers that come with it.

Chosen by measuring on box-3: BFGS (with the exact Hessian it has to be made convex by an eigenvalue decomposition in
every iteration, and CasADi 3.8 gave up), DAQP before OSQP (1.6 times as long), PIQP and ProxQP (three times); its
default qrQP takes seconds for a single QP of this size.
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

_QP_SOLVERS: dict[str, dict[str, Any]] = {
    "daqp": {},
    "osqp": {"osqp": {"verbose": False, "eps_abs": 1e-5, "eps_rel": 1e-5}},
    "qrqp": {"print_iter": False, "print_header": False, "print_info": False},
}
"""In the order of preference; the last always comes along."""


def smoothed(case: Case, x: FloatArray, watch: Watch) -> Answer:
    """Solve with log-sum-exp for the minimum, its sharpness raised in stages."""
    transcription = Transcription(case, soft=True)
    viewer = Viewer(transcription, watch)
    short = _solver(transcription, viewer, ITERATIONS)
    stages = [(sharpness, short) for sharpness in SHARPNESS[:-1]]
    stages.append((SHARPNESS[-1], _solver(transcription, viewer, LONG)))
    return run(case, x, watch, transcription, stages, viewer)


def _solver(transcription: Transcription, viewer: Viewer, iterations: int) -> Any:
    name = next(name for name in _QP_SOLVERS if cs.has_conic(name))
    options = {
        "iteration_callback": viewer,
        "error_on_fail": False,
        "print_time": False,
        "print_header": False,
        "print_iteration": False,
        "print_status": False,
        "max_iter": iterations,
        "hessian_approximation": "limited-memory",
        "tol_pr": 1e-6,
        "tol_du": 1e-3,
        "qpsol": name,
        "qpsol_options": {"error_on_fail": False, **_QP_SOLVERS[name]},
    }
    return cs.nlpsol("solver", "sqpmethod", transcription.nlp, options)
