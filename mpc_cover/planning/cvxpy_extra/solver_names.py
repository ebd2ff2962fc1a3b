"""Solvers that CVXPY has here, by the names that `--backend` takes."""

from __future__ import annotations

from mpc_cover.errors import UserError

DEFAULT_SOLVER = "clarabel"
"""It takes every cone that users write without a thought: norms, squares, exponentials."""


def check_solver(name: str, *, exact_cones: bool = False) -> None:
    """Refuse a solver that CVXPY does not have here, or that lacks the cones asked for.

    Raises
    ------
    UserError
        The message lists those that there are.
    """
    import cvxpy as cp  # noqa: PLC0415 - others need not wait for it
    from cvxpy.reductions.solvers.defines import INSTALLED_CONIC_SOLVERS, QP_SOLVERS  # noqa: PLC0415 - likewise

    able = set(INSTALLED_CONIC_SOLVERS) - set(QP_SOLVERS) - {"SCIPY"}  # SciPy's solves linear programmes
    known = able if exact_cones else {*able, *(set(QP_SOLVERS) & set(cp.installed_solvers()))}
    if name.upper() not in known:
        what = "has no second-order cones" if exact_cones and name.upper() in QP_SOLVERS else "is none of CVXPY's here"
        raise UserError(f"backend {name}: {what}: must be one of {', '.join(sorted(each.lower() for each in known))}")
