"""One offline solve of the whole mission: `mpc-cover plan`."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpc_cover import __version__
from mpc_cover.model.sensing import covered_at
from mpc_cover.planning.engine import Engine
from mpc_cover.planning.task import Task
from mpc_cover.trajectory import Trajectory

if TYPE_CHECKING:
    from mpc_cover.mission.load import Mission


def plan_offline(mission: Mission, *, backend: str, seed: int) -> Trajectory:
    """Return a plan for the whole mission from its start, thoroughly made; it ends at rest.

    Raises
    ------
    UserError
        For an unknown back-end.
    """
    fleet, cell = mission.fleet, mission.field.cell
    weight = np.ones((fleet.radius.shape[1], cell.shape[0]))
    still = np.zeros_like(fleet.start)
    task = Task(fleet, cell, weight, fleet.start, still, 0.0, mission.spec.control.period_s)
    candidate = Engine(backend).whole(task, None)
    plan = candidate.plan
    return Trajectory(
        time=plan.time(),
        position=plan.position,
        velocity=plan.velocity,
        input=plan.input,
        cell=cell,
        covered_at=covered_at(plan.time(), plan.position, cell, fleet.radius),
        agent_id=fleet.ids,
        mission=mission,
        meta={"kind": "plan", "version": __version__, "seed": seed, "backend": backend, "guess": candidate.kind},
    )
