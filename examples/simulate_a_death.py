"""Fly a mission in closed loop; one agent dies on the way, and the others share its work.

Usage: python examples/simulate_a_death.py [FOLDER]
"""

import sys
from pathlib import Path

import mpc_cover

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "out")
folder.mkdir(parents=True, exist_ok=True)

mission = mpc_cover.load_mission(Path(__file__).parent / "yard.yaml")
flight = mpc_cover.simulate(mission, deaths={"a2": 3.0})  # at this mission time [s], as if its process were killed
report = mpc_cover.check(flight.recording)

mpc_cover.save_trajectory(flight.recording, folder / "flight.npz")
mpc_cover.plot(flight.recording, folder, step_times=flight.step_times)
separation = next(check for check in report.checks if check.name == "separation")
print(f"{flight.outcome}, after {flight.recording.end_time:g} s; verified: {report.holds}; {separation}")
