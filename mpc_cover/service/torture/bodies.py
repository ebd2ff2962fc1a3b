"""The true motion of each agent, through all lives of its process: what the oracle sees."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.service.agent.recorder import MemoryRecorder, Piece
from mpc_cover.service.run.recording import extended

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray
    from mpc_cover.service.torture.processes import Process


@dataclass(eq=False)
class _Life:
    """One process of an agent: its clock, and what it recorded by it."""

    process: Process
    recorder: MemoryRecorder = field(default_factory=MemoryRecorder)


@dataclass(eq=False)
class Body:
    """An agent's body: it moves as its process has it fly, and brakes when that dies."""

    name: str
    input_max: float
    start: FloatArray
    lives: list[_Life] = field(default_factory=list)

    def begin(self, process: Process) -> MemoryRecorder:
        """Begin the life of another process; return the recorder of its motion."""
        self.lives.append(_Life(process))
        return self.lives[-1].recorder

    def at(self, world_s: float) -> FloatArray:
        """Return where it is at a virtual time [s] after the end of its last process (d,) [m]."""
        if not self.lives or not self.lives[-1].recorder.pieces:
            return self.start
        return np.array(self._pieces(self.lives[-1], world_s)[-1].position)

    def motion(self, end_s: float) -> list[Piece]:
        """Return its motion in virtual time up to `end_s`, piece by piece."""
        ends = [life.process.clock.world_s(life.recorder.pieces[0].time_s) for life in self.lives[1:]] + [end_s]
        return [piece for life, until_s in zip(self.lives, ends, strict=True) for piece in self._pieces(life, until_s)]

    def _pieces(self, life: _Life, until_s: float) -> list[Piece]:
        """Return what a process flew, and how its body went on without it until a virtual time [s]."""
        clock, pieces = life.process.clock, life.recorder.pieces
        whole = extended(pieces, self.input_max, clock.at(until_s)) if pieces else []
        return [Piece(clock.world_s(p.time_s), p.position, p.velocity, p.input, p.plan) for p in whole]
