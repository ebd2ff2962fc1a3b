"""Append a constraint of one's own to the convex subproblem, written in CVXPY, and see what it costs.

The subproblem around a plan that leaves something over is solved as it is, then with the north-east corner closed: a
half-plane that nobody may enter. Its optimum is the majoriser's, in metres, as J is.

Usage: python examples/add_a_cvxpy_constraint.py
"""

from pathlib import Path

import mpc_cover
from mpc_cover.planning.cvxpy_reference import build_cvxpy_subproblem
from mpc_cover.planning.ocp import Settings, requirements
from mpc_cover.planning.offline import offline_task
from mpc_cover.planning.scp import length_scale, softness_at

FENCE_M = 9.5  # x + y of whoever stands at the corner's edge

mission = mpc_cover.load_mission(Path(__file__).parent / "yard.yaml")
guess = mpc_cover.plan(mission, time_limit_s=1.0)
ocp = offline_task(mission).ocp(guess.steps)
settings, x = Settings(softness_at(30.0, length_scale(ocp))), ocp.decision_of(guess)
reference = build_cvxpy_subproblem(ocp, settings, requirements(ocp, settings.margins), x, radius=1.0)

free = reference.solve()
reference.constraints += [q[:, 0] + q[:, 1] <= FENCE_M for q in reference.position]
fenced = reference.solve()
nearest = max((q.value[:, 0] + q.value[:, 1]).max() for q in reference.position)
print(f"optimum {free:.3f} m without, {fenced:.3f} m with the corner closed; x + y = {nearest:.3f} at the most")
