"""Plan with a constraint and a term of one's own, written in CVXPY: nobody enters a disc, and inputs cost something.

Usage: python examples/add_a_cvxpy_constraint.py; or, in the folder examples,
mpc-cover plan yard.yaml --formulation cvxpy --extra add_a_cvxpy_constraint:keep_out --out plan.npz
mpc-cover check plan.npz --extra add_a_cvxpy_constraint:keep_out
"""

from pathlib import Path
from typing import Any

import cvxpy as cp
import numpy as np

import mpc_cover

CENTRE_M, RADIUS_M = np.array([4.5, 4.5]), 1.0


def keep_out(motion: mpc_cover.MotionVariables, mission: mpc_cover.Mission) -> tuple[list[Any], dict[str, Any]]:
    """Keep out of a disc: its outside is not convex, so that a half-plane at the iterate stands for it."""
    away = motion.iterate.position - CENTRE_M
    away /= np.maximum(np.linalg.norm(away, axis=2, keepdims=True), 1e-9)
    outside = cp.sum(cp.multiply(away, motion.position - CENTRE_M), axis=2) >= RADIUS_M
    return [0.01 * mission.spec.control.period_s * cp.sum_squares(motion.input)], {"disc": outside}


if __name__ == "__main__":
    plan = mpc_cover.plan(Path(__file__).parent / "yard.yaml", formulation="cvxpy", extra=keep_out)
    nearest = np.linalg.norm(plan.position - CENTRE_M, axis=2).min()
    print(f"J = {plan.meta['cost_m']:.3f} m, {plan.meta['cvxpy']['status']}; nobody came nearer than {nearest:.3f} m")
