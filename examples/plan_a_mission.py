"""Plan a mission offline, as short as can be found in two seconds; verify the plan and draw it.

Usage: python examples/plan_a_mission.py [FOLDER]
"""

import sys
from pathlib import Path

import mpc_cover

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "out")
folder.mkdir(parents=True, exist_ok=True)

mission = mpc_cover.load_mission("box-3")
plan = mpc_cover.plan(mission, min_time=True, time_limit_s=2.0)
report = mpc_cover.check(plan)  # shares no code with the planner

mpc_cover.save_trajectory(plan, folder / "plan.npz")
mpc_cover.plot(plan, folder)
print(f"{plan.end_time:g} s, J = {plan.meta['cost_m']:g} m, verified: {report.holds}; figures in {folder}")
