"""Plan the same mission with each QP back-end, and compare what is left over, J, after the same time.

Usage: python examples/swap_the_backend.py
"""

from pathlib import Path
from time import perf_counter

import mpc_cover

mission = mpc_cover.load_mission(Path(__file__).parent / "yard.yaml")
for backend in ("piqp", "clarabel", "osqp"):
    begun = perf_counter()
    plan = mpc_cover.plan(mission, backend=backend, time_limit_s=1.0)
    taken = perf_counter() - begun
    print(f"{backend}: J = {plan.meta['cost_m']:.3f} m after {taken:.2f} s")
