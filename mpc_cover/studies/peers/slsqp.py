"""SciPy's SLSQP on the condensed form: the thesis's own way (a dense SQP in v = (z0, u), 3.19 to 3.22).

All derivatives are exact. Most time is spent on the dense least-squares problem in every iteration, with a row for
each sample and constraint.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from scipy.optimize import minimize

from mpc_cover.coverage.majoriser import Softness
from mpc_cover.planning.scp import length_scale, softness_at
from mpc_cover.studies.peers.condensed import Condensed
from mpc_cover.studies.watch import Enough

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mpc_cover.arrays import FloatArray
    from mpc_cover.studies.case import Case
    from mpc_cover.studies.watch import Answer, Watch

SHARPNESS = (4.0, 8.0, 20.0, 40.0)
"""As for IPOPT."""
ITERATIONS = 60
"""Bound on all stages but the last, as for IPOPT; on box-3 neither 40 nor 100 was better from both guesses."""
LONG = 3000
_HARD = 1e6
"""A soft minimum of this sharpness is the minimum itself, and its gradient that of the nearest sample."""


def smoothed(case: Case, x: FloatArray, watch: Watch) -> Answer:
    """Solve with log-sum-exp for the minimum, its sharpness raised in stages."""
    scale, points = length_scale(case.ocp), (case.ocp.steps + 1) * case.ocp.fleet.size
    stages = [replace(softness_at(sharpness, scale), count=points) for sharpness in SHARPNESS]
    return _run(case, x, watch, stages)


def hard(case: Case, x: FloatArray, watch: Watch) -> Answer:
    """Solve with the minimum as it is, as the thesis does; the margin is that of the sharpest soft minimum."""
    scale = length_scale(case.ocp)
    margin = softness_at(SHARPNESS[-1], scale).margin
    return _run(case, x, watch, [Softness(beta=_HARD / scale, margin=margin, count=1)])


def _run(case: Case, x: FloatArray, watch: Watch, stages: Sequence[Softness]) -> Answer:
    form = Condensed(case)
    matrix, right = form.ends()
    v, iterations, status = form.pack(x), 0, "nothing to do"

    def shown(v: FloatArray) -> None:
        nonlocal x, iterations
        iterations += 1
        x = form.unpack(v)
        if watch.see(x):
            raise Enough

    watch.begin(x)
    for number, softness in enumerate(stages, start=1):
        edges = form.edges(v)
        constraints: list[Any] = [
            {"type": "eq", "fun": lambda v: matrix @ v - right, "jac": lambda _: matrix},
            {"type": "ineq", "fun": form.slack, "jac": form.slack_jacobian, "args": (edges,)},
        ]
        options: Any = {
            "args": (softness,),
            "constraints": constraints if right.size else constraints[1:],
            "callback": shown,
            "options": {"maxiter": LONG if number == len(stages) else ITERATIONS, "ftol": 1e-6},
        }
        try:
            result = minimize(form.cost, v, jac=True, method="SLSQP", **options)
        except Enough:
            status = "everything is covered" if watch.complete else "time is up"
            break
        v, status = result.x, str(result.message)
        x = form.unpack(v)
    return watch.answer(x, iterations, status)
