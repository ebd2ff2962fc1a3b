"""Evidence of losses: a file may call an agent lost only if its motion is that of one, and the lost measure nothing.

Whoever dies in flight brakes with full input, and stays where it comes to rest (`service.run.recording.extended`); a
single integrator stops at once. What a "lost" agent does otherwise is the flight of a living one.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.mission.config import Dynamics
from mpc_cover.verification.report import Check, CheckName

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray
    from mpc_cover.trajectory_file import Recording

SAME_TIME = 1e-6
"""A sample this near to the time of a loss is that of the loss [s]: records are merged to 1e-7 s. A plain choice."""
_TOLERANCES = 10.0
"""How many tolerances of a residual a braking motion may differ by, as residuals may in sum; a plain choice."""


def check_losses(trajectory: Recording, losses: dict[int, float], tolerance: float, *, time_s: float = 0.0) -> Check:
    """Check that all lost agents brake with full input from their losses [s] on, and rest for good.

    `time_s` is how exactly the file holds times [s].
    """
    ids, worst, where = trajectory.mission.fleet.ids, np.inf, "nobody moves after its loss"
    for index, loss in losses.items():
        after, off = _deviation(trajectory, index, loss, SAME_TIME + 2.0 * time_s)
        if not off.size:
            continue
        margin = _TOLERANCES * tolerance - float(off.max())
        if margin < worst:
            worst = margin
            first = int(np.argmax(off > _TOLERANCES * tolerance)) if margin < 0.0 else int(np.argmax(off))
            what = "flies on" if margin < 0.0 else "lost"
            where = f"{ids[index]}, lost at t = {loss:.3f} s, {what}, t = {after[first]:.3f} s"
    return Check(CheckName.LOSSES, worst >= 0.0, worst, "m", where)


def _deviation(trajectory: Recording, index: int, loss: float, same_s: float) -> tuple[FloatArray, FloatArray]:
    """Return the samples after a loss (n,) [s], and by how much each is off the motion of the lost (n,) [m], [m/s]."""
    time = trajectory.time
    row = int(np.argmin(np.abs(time - loss)))
    begin = float(time[row])
    if abs(begin - loss) > same_s:  # within an interval, whose input goes on until its end
        row = max(int(np.searchsorted(time, loss, side="right")) - 1, 0)
        begin = max(loss, float(time[0]))
    after = slice(row + 1, None)
    if row + 1 >= time.size:
        return time[after], time[after]
    elapsed = begin - float(time[row])
    velocity = trajectory.velocity[row, index] + elapsed * trajectory.input[row, index]
    position = trajectory.position[row, index] + elapsed * trajectory.velocity[row, index]
    position = position + 0.5 * elapsed**2 * trajectory.input[row, index]
    if trajectory.mission.spec.fleet.dynamics is Dynamics.SINGLE:
        velocity = np.zeros_like(velocity)
    speed, force = float(np.linalg.norm(velocity)), float(trajectory.mission.fleet.input_max[index])
    braking = np.minimum(time[after] - begin, speed / force)
    way, left = speed * braking - 0.5 * force * braking**2, speed - force * braking
    ahead = velocity / speed if speed > 0.0 else velocity
    away = np.linalg.norm(trajectory.position[after, index] - position - way[:, None] * ahead, axis=1)
    faster = np.linalg.norm(trajectory.velocity[after, index] - left[:, None] * ahead, axis=1)
    return time[after], np.maximum(away, faster)


def of_the_living(trajectory: Recording, losses: dict[int, float], slack_s: float = SAME_TIME) -> Recording:
    """Return the recording with NaN for the positions of lost agents from `slack_s` [s] after their losses on.

    Nothing is measured from there. A negative slack is that before the losses. Whoever was lost before the record
    begins had measured where it stands at its beginning.
    """
    if not losses:
        return trajectory
    position = trajectory.position.copy()
    for index, loss in losses.items():
        position[trajectory.time > max(loss, float(trajectory.time[0])) + slack_s, index] = np.nan
    return replace(trajectory, position=position)
