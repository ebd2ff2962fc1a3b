"""Parts of figures that depend on a mission's kind of information: the meaning of dark cells, and ages of looks."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mpc_cover.mission.information import AgeingInformation, EffectiveInformation, KalmanInformation
from mpc_cover.verification.information_summary import age_history
from mpc_cover.view.style import GOOD, INK, draw_limit

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from mpc_cover.mission.load import Mission
    from mpc_cover.trajectory_file import Recording


def is_patrol(mission: Mission) -> bool:
    """Return whether looks grow old in the mission."""
    return isinstance(mission.spec.information, AgeingInformation)


def meaning_of_dark(mission: Mission) -> str:
    """Return what dark cells mean."""
    match mission.spec.information:
        case AgeingInformation(age_limit_s=limit):
            return f"the darker, the older at the end; black: {limit:g} s or more"
        case KalmanInformation(target_variance=target):
            return f"dark: variance above {target:g}"
        case EffectiveInformation(level=level):
            return f"dark: looks come to less than {level:g}"
        case _:
            looks = mission.spec.looks
            return f"dark: fewer than {looks} looks" if looks > 1 else "dark: never"


def draw_ages(axes: Axes, trajectory: Recording) -> None:
    """Draw a patrol's worst and mean age over time, and its limit."""
    history = age_history(trajectory)
    time, over = trajectory.time, max(history.limit_s, float(history.worst_s.max()))
    axes.plot(time, history.worst_s, color=INK, linewidth=2.0, label="worst")
    axes.plot(time, history.mean_s, color=GOOD, linewidth=2.0, label="mean")
    draw_limit(axes, history.limit_s, f"limit {history.limit_s:g} s")
    axes.legend(loc="upper left", ncols=2).set_in_layout(False)
    axes.set_ylim(0.0, 1.35 * over)
    axes.set_xlim(float(time[0]), float(time[-1]))
    axes.set_title("Ages of the cells' last looks")
    axes.set_xlabel("time [s]")
    axes.set_ylabel("age [s]")


def headline_of_patrol(trajectory: Recording) -> str:
    """Return the largest age of looks, and the duration of the patrol."""
    history = age_history(trajectory)
    end = trajectory.time[-1]
    return f"looks at most {history.worst_s.max():.1f} s old (limit {history.limit_s:g} s) in {end:.1f} s"
