"""`mpc-cover` with `EveryFaultLaw` for a control law; its good plans are appended to good.jsonl."""

import json
import sys
from pathlib import Path

from sweep_laws import EveryFaultLaw

from mpc_cover import cli
from mpc_cover.control import factory

GOAL_Y = 15.5


def told(plan):
    """Write a plan down, agent by agent."""
    with Path("good.jsonl").open("a", encoding="utf-8") as file:
        for index in range(plan.position.shape[1]):
            parts = {name: getattr(plan, name)[:, index].tolist() for name in ("position", "velocity", "input")}
            file.write(json.dumps(parts) + "\n")


if __name__ == "__main__":
    factory.make_control_law = lambda mission, **_: EveryFaultLaw(mission, GOAL_Y, told)
    sys.argv[0] = "mpc-cover"
    cli.main()
