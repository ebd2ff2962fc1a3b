"""How accurate each back-end is asked to be, and how close it then comes to an analytic solution."""

from __future__ import annotations

from solvers.backends.options import Options

# what an analytic solution must be met to: OSQP's accuracy costs iterations
TIGHT = {
    "osqp": Options(tolerance=1e-7),
    "clarabel": Options(tolerance=1e-9),
    "piqp": Options(tolerance=1e-9),
    "native": Options(tolerance=1e-9),
}
CLOSE = {"osqp": 1e-4, "clarabel": 1e-6, "piqp": 1e-6, "native": 1e-6}
