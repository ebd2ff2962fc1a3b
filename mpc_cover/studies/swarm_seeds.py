"""Many seeds of a scenario: `python -m mpc_cover.studies.swarm_seeds --case 6.2 --seeds 100`."""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.studies.swarm import run
from mpc_cover.studies.thesis_cases import CASES

if TYPE_CHECKING:
    from mpc_cover.studies.swarm_parameters import Scenario


@dataclass(frozen=True)
class SeedResult:
    """One run in figures.

    Attributes
    ----------
    covered : whether everything was measured.
    time_s : to cover 95, 99 and 100 % of the cells, and until everyone knew; inf for never.
    closest_m : smallest distance along the continuous path.
    bottleneck_m : least range that connects the fleet at every instant.
    distance_m : travelled by all together.
    """

    seed: int
    covered: bool
    time_s: tuple[float, float, float, float]
    closest_m: float
    bottleneck_m: float
    distance_m: float


def run_seeds(scenario: Scenario, seeds: range) -> list[SeedResult]:
    """Fly a scenario once for each seed."""
    results = []
    for seed in seeds:
        record = run(scenario, seed)
        times = (record.time_to(0.95), record.time_to(0.99), record.time_to_cover, record.time_to_know)
        together = float(record.distance.sum())
        results.append(SeedResult(seed, record.covered, times, record.closest, record.bottleneck, together))
    return results


def summary(name: str, results: list[SeedResult]) -> str:
    """Return a paragraph about the runs of a case."""
    time = np.array([result.time_s for result in results])
    covered = sum(result.covered for result in results)
    lines = [f"{name}: {covered} of {len(results)} seeds covered everything"]
    for label, column in zip(("95 %", "99 %", "100 %", "all know"), time.T, strict=True):
        lines.append(f"  {label:<9} median {np.median(column):6.1f} s, worst {column.max():6.1f} s")
    closest, widest = min(r.closest_m for r in results), max(r.bottleneck_m for r in results)
    lines.append(f"  closest at any instant {closest:.4f} m, bottleneck at any instant {widest:.4f} m")
    return "\n".join(lines)


def main(arguments: list[str] | None = None) -> None:
    """Print the summary of the cases asked for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--case", choices=sorted(CASES), action="append", help="may be repeated; default: all")
    parser.add_argument("--seeds", type=int, default=100)
    options = parser.parse_args(arguments)
    for name in options.case or CASES:
        sys.stdout.write(summary(name, run_seeds(CASES[name], range(options.seeds))) + "\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main()
