"""The runs of a study: each as plain data that any worker can read, and the mission that it flies."""

from __future__ import annotations

import hashlib
import json
import math
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

from mpc_cover.mission.load import build_mission, mission_from_json
from mpc_cover.studies.starts import Starts, random_starts

if TYPE_CHECKING:
    from mpc_cover.mission.load import Mission


@dataclass(frozen=True)
class Run:
    """One flight of a study: everything that determines its result.

    Attributes
    ----------
    name : of the mission.
    mission : the whole mission as JSON, as it was read.
    controller : a name in `controllers.CONTROLLERS`.
    backend, horizon_steps : None for controllers that have neither.
    period_s : T_s.
    seed : of the disturbances, of what is random in the controller, and of random starts.
    starts : where the fleet starts.
    """

    name: str
    mission: str
    controller: str
    backend: str | None
    horizon_steps: int | None
    period_s: float
    seed: int
    starts: Starts

    @property
    def key(self) -> str:
        """Name of the run's file: the same for the same parameters on any machine."""
        return hashlib.sha256(json.dumps(asdict(self), sort_keys=True).encode()).hexdigest()[:32]

    @property
    def horizon_s(self) -> float | None:
        """The horizon [s]."""
        return None if self.horizon_steps is None else self.horizon_steps * self.period_s

    @property
    def title(self) -> str:
        """The run in a few words."""
        steps = "" if self.horizon_steps is None else f" N = {self.horizon_steps}"
        backend = "" if self.backend is None else f" {self.backend}"
        return f"{self.name} {self.controller}{steps}, T = {self.period_s:g} s{backend}, seed {self.seed}"

    def build(self) -> Mission:
        """Return the mission with this run's period, horizon and starts.

        A controller without a horizon gets as many steps as the mission's own horizon lasts. With random starts
        the section `planning`, which a closed loop does not use, is dropped: its ends may require given starts.

        Raises
        ------
        InvalidInputError
            The mission is invalid, as with a horizon shorter than it takes to brake.
        UserError
            No random starts were found.
        """
        raw = json.loads(self.mission)
        control = raw["control"]
        lasts = control["horizon_steps"] * control["period_s"]
        control["horizon_steps"] = self.horizon_steps or math.ceil(lasts / self.period_s - 1e-9)
        control["period_s"] = self.period_s
        if self.starts == Starts.RANDOM:
            raw.pop("planning", None)
            self._draw_starts(raw)
        return build_mission(raw, self._what(control["horizon_steps"]))

    def _draw_starts(self, raw: dict[str, Any]) -> None:
        mission = mission_from_json(self.mission, f"mission {self.name}")
        for agent, start in zip(raw["fleet"]["agents"], random_starts(mission, self.seed).tolist(), strict=True):
            agent["start_m"] = start

    def _what(self, steps: int) -> str:
        lasts = f"{steps} steps ({steps * self.period_s:g} s)"
        return f"mission {self.name} with a horizon of {lasts} and a period of {self.period_s:g} s"
