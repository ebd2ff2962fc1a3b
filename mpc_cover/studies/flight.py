"""A flight of a study, with a controller or without: both give the same kind of result, to be measured alike."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.service.controller.step_log import StepKind
from mpc_cover.service.run.simulate import simulate
from mpc_cover.service.run.swarm_simulate import fly_swarm

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray
    from mpc_cover.control.control_law import ControlLaw
    from mpc_cover.mission.load import Mission
    from mpc_cover.trajectory_file import Recording

_CONTROL_KEYS = frozenset({"state", "plan", "word"})
"""Keys of the messages that control needs; status, maps and events for users are not counted."""


@dataclass(frozen=True, eq=False)
class Flight:
    """What was flown, and its cost in time and messages.

    Attributes
    ----------
    trajectory : the motion, with the mission that it is judged by.
    complete : whether the controller, or without one every agent, found everything covered in time.
    step_s : (S,) durations of the control steps [s], with prediction and publication; without a controller, of each
        decision of each agent.
    agents_per_step : for how many agents such a step decides.
    plan_sources : the source of each step's plan (`PlanSource`), by name; empty without a controller.
    prepare_s : planning before the start [s].
    messages, bytes : of states, plans and broadcasts sent by all, each once, however many receive it.
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
    """Fly a mission by one controller, as `mpc-cover simulate` does; `backend` solves the law's QPs."""
    traffic = _Traffic()
    flown = simulate(mission, backend=backend, seed=seed, law=law, channel=traffic)
    steps = [step for step in flown.steps if step.kind is StepKind.STEP]
    return Flight(
        trajectory=flown.trajectory,
        complete=flown.complete,
        step_s=np.array([step.tick_time_s for step in steps]),
        agents_per_step=mission.fleet.size,
        plan_sources=tuple(step.plan_source for step in steps),
        prepare_s=sum(step.tick_time_s for step in flown.steps if step.kind is StepKind.PREPARE),
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
        step_s=np.array([time_s for each in flown.decision_times_s.values() for time_s in each]),
        agents_per_step=1,
        plan_sources=(),
        prepare_s=0.0,
        messages=traffic.count["messages"],
        bytes=traffic.count["bytes"],
    )


class _Traffic:
    """A lossless channel that counts the messages that control needs; see `LocalBus`."""

    def __init__(self) -> None:
        self.count: Counter[str] = Counter()

    def __call__(self, key: str, payload: bytes) -> list[bytes]:
        if key.rsplit("/", 1)[-1] in _CONTROL_KEYS:
            self.count.update(messages=1, bytes=len(payload))
        return [payload]
