"""A flight of a study: with a controller or without one, the result is of one kind and is measured alike."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.service.run.simulate import simulate
from mpc_cover.service.run.swarm_simulate import fly_swarm

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray
    from mpc_cover.control.control_law import ControlLaw
    from mpc_cover.mission.load import Mission
    from mpc_cover.trajectory_file import Recording

_CONTROL_KEYS = frozenset({"state", "plan", "word"})
"""Keys on which what control needs is sent; status, maps for people and events are not counted."""


@dataclass(frozen=True, eq=False)
class Flight:
    """What was flown, and what it took.

    Attributes
    ----------
    trajectory : the motion, with the mission that it is judged by.
    complete : whether whoever is in charge, or every agent, found everything covered in time.
    step_s : (S,) what each control step took [s]: with prediction and dispatch; without a controller, each decision
        of each agent.
    agents_per_step : for how many agents such a step decides.
    plan_sources : where each step's plan came from (`PlanSource`), by name; empty without a controller.
    prepare_s : planning before the start [s].
    messages, bytes : of states, plans and words sent by everyone, each once, however many hear it.
    """

    trajectory: Recording
    complete: bool
    step_s: FloatArray
    agents_per_step: int
    plan_sources: tuple[str, ...]
    prepare_s: float
    messages: int
    bytes: int


def fly_by_controller(mission: Mission, law: ControlLaw, backend: str, seed: int) -> Flight:
    """Fly a mission by one controller, as `mpc-cover simulate` does; `backend` is what the law's QPs are solved by."""
    traffic = _Traffic()
    flown = simulate(mission, backend=backend, seed=seed, law=law, channel=traffic)
    steps = [step for step in flown.steps if step.kind == "step"]
    return Flight(
        trajectory=flown.trajectory,
        complete=flown.complete,
        step_s=np.array([step.tick_time_s for step in steps]),
        agents_per_step=mission.fleet.size,
        plan_sources=tuple(step.plan_source for step in steps),
        prepare_s=sum(step.tick_time_s for step in flown.steps if step.kind == "prepare"),
        messages=traffic.count["messages"],
        bytes=traffic.count["bytes"],
    )


def fly_without_controller(mission: Mission, seed: int) -> Flight:
    """Fly a mission by the potential law, each agent by itself, as `mpc-cover simulate --controller potential` does.

    Raises
    ------
    UserError
        The law cannot fly this mission.
    """
    traffic = _Traffic()
    flown = fly_swarm(mission, seed=seed, channel=traffic)
    return Flight(
        trajectory=flown.trajectory,
        complete=flown.complete,
        step_s=np.array([taken for each in flown.decide_s.values() for taken in each]),
        agents_per_step=1,
        plan_sources=(),
        prepare_s=0.0,
        messages=traffic.count["messages"],
        bytes=traffic.count["bytes"],
    )


class _Traffic:
    """A channel that loses nothing and counts what control needs; see `LocalBus`."""

    def __init__(self) -> None:
        self.count: Counter[str] = Counter()

    def __call__(self, key: str, payload: bytes) -> list[bytes]:
        if key.rsplit("/", 1)[-1] in _CONTROL_KEYS:
            self.count.update(messages=1, bytes=len(payload))
        return [payload]
