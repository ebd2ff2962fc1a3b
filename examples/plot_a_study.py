"""Fly a mission with two horizons from two random starts each, and draw what came of it.

Usage: python examples/plot_a_study.py [FOLDER]
"""

import sys
from pathlib import Path

from rich.console import Console

from mpc_cover.studies.executors import LocalExecutor
from mpc_cover.studies.grid import Grid
from mpc_cover.studies.horizon import run_study

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "out")
grid = Grid(missions=[str(Path(__file__).parent / "yard.yaml")], horizons=["6", "12"], seeds=2)
study = run_study(grid, folder, LocalExecutor(1), Console(quiet=True), command="examples/plot_a_study.py")

pictures = [file.name for file in study.files if file.suffix == ".png"]
print(f"{study.finished} of {study.wanted} runs; {', '.join(pictures)} in {folder}")
