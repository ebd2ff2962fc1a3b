"""What a user's function is given: the motion of the fleet as CVXPY expressions, in the mission's coordinates."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import cvxpy as cp
import numpy as np

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray
    from mpc_cover.model.local_frame import LocalFrame
    from mpc_cover.model.trajectory import Trajectory
    from mpc_cover.planning.cvxpy_reference import CvxpySubproblem


@dataclass(frozen=True, eq=False)
class MotionVariables:
    """The motion that is decided, as CVXPY expressions, for m agents in d dimensions at T samples.

    In the mission's own coordinates and units, whatever the planner computes in. A plan has a sample every
    `control.period_s`, a recording its own ones.

    Attributes
    ----------
    position, velocity : (T, m, d) [m], [m/s]; sample 0 is the start.
    input : (T-1, m, d) accelerations [m/s^2], each held until the next sample.
    time : (T,) [s], numbers.
    iterate : the motion around which the convex subproblem is made, in numbers: constraints that are not convex are to
        be linearised there. Of a motion that is judged, the motion itself.
    agent_id : (m,) names.
    """

    position: Any
    velocity: Any
    input: Any
    time: FloatArray
    iterate: Trajectory
    agent_id: tuple[str, ...]

    @classmethod
    def fixed(cls, motion: Trajectory, agent_id: tuple[str, ...]) -> MotionVariables:
        """Return variables whose values are those of a motion [m]."""
        values = {"position": motion.position, "velocity": motion.velocity, "input": motion.input}
        position, velocity, force = (cp.Variable(each.shape, name=name, value=each) for name, each in values.items())
        return cls(position, velocity, force, motion.time, motion.plain(), agent_id)

    @classmethod
    def near(cls, motion: Trajectory, agent_id: tuple[str, ...]) -> tuple[MotionVariables, list[Any]]:
        """Return a motion [m] plus variables, all of value 0, and these variables."""
        values = (motion.position, motion.velocity, motion.input)
        aside = [cp.Variable(value.shape, value=np.zeros_like(value)) for value in values]
        position, velocity, force = (value + part for value, part in zip(values, aside, strict=True))
        return cls(position, velocity, force, motion.time, motion.plain(), agent_id), aside

    @classmethod
    def planned(
        cls, subproblem: CvxpySubproblem, frame: LocalFrame, iterate: Trajectory, agent_id: tuple[str, ...]
    ) -> MotionVariables:
        """Return the motion of a subproblem in a local frame, at the samples of the `iterate` [m].

        The iterate has as many samples for each step of the subproblem as the input is held for.
        """
        shape, steps = iterate.position.shape, subproblem.force.shape[0]
        parts = iterate.steps // steps
        width = int(np.prod(shape[1:]))
        position, velocity, force = (
            frame.length * cp.reshape(each, (each.shape[0], width), order="C")
            for each in (subproblem.position, subproblem.velocity, subproblem.force)
        )
        elapsed = iterate.period * np.arange(parts)
        flown = [position[:-1] + s * velocity[:-1] + 0.5 * s**2 * force for s in elapsed]
        moving = [velocity[:-1] + s * force for s in elapsed]
        held = cp.hstack([force] * parts)
        origin = np.broadcast_to(frame.origin, shape)
        return cls(
            origin + _at_samples(flown, position[-1], shape),
            _at_samples(moving, velocity[-1], shape),
            cp.reshape(held, (shape[0] - 1, *shape[1:]), order="C"),
            iterate.time,
            iterate,
            agent_id,
        )


def _at_samples(parts: list[Any], last: Any, shape: tuple[int, ...]) -> Any:
    """Return (T, m, d) values of those at each part of all steps, (N, m d) each, and of the last sample, (m d,)."""
    return cp.reshape(cp.hstack([cp.vec(cp.hstack(parts), order="C"), last]), shape, order="C")
