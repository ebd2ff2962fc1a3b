"""SciPy's SLSQP on the condensed form: the thesis's own way (a dense SQP in v = (z0, u), 3.19 to 3.22).

All derivatives are exact. The soft minimum and its continuation are those of the other peers: with the minimum as
it is, as in the thesis, it stopped earlier and higher. What takes its time is the dense least-squares problem in
every iteration, with a row for each sample and constraint.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from scipy.optimize import minimize

from mpc_cover.planning.continuation import length_scale, softness_at
from mpc_cover.studies.peers.condensed import Condensed
from mpc_cover.studies.watch import Enough

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray
    from mpc_cover.studies.case import Case
    from mpc_cover.studies.watch import Answer, Watch

SHARPNESS = (4.0, 8.0, 20.0, 40.0)
"""As for IPOPT."""
ITERATIONS = 40
"""Bound on all stages but the last."""
LONG = 3000


def smoothed(case: Case, x: FloatArray, watch: Watch) -> Answer:
    """Solve with log-sum-exp for the minimum, its sharpness raised in stages."""
    form = Condensed(case)
    matrix, right = form.ends()
    scale, points = length_scale(case.window), (case.window.steps + 1) * case.window.fleet.size
    v, iterations, status = form.pack(x), 0, "nothing to do"

    def shown(v: FloatArray) -> None:
        nonlocal x, iterations
        iterations += 1
        x = form.unpack(v)
        if watch.see(x):
            raise Enough

    watch.begin(x)
    for sharpness in SHARPNESS:
        softness = replace(softness_at(sharpness, scale), count=points)
        edges = form.edges(v)
        constraints = [
            {"type": "eq", "fun": lambda v: matrix @ v - right, "jac": lambda _: matrix},
            {"type": "ineq", "fun": form.slack, "jac": form.slack_jacobian, "args": (edges,)},
        ]
        try:
            result = minimize(
                form.cost,
                v,
                args=(softness,),
                jac=True,
                method="SLSQP",
                constraints=constraints if right.size else constraints[1:],
                callback=shown,
                options={"maxiter": LONG if sharpness == SHARPNESS[-1] else ITERATIONS, "ftol": 1e-6},
            )
        except Enough:
            status = "everything is covered" if watch.complete else "time is up"
            break
        v, status = result.x, str(result.message)
        x = form.unpack(v)
    return watch.answer(x, iterations, status)
