"""Summary of a run: what was covered and when, and how near its limits the fleet came."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mpc_cover.mission.config import Sensing
from mpc_cover.trajectory_file import RecordingKind
from mpc_cover.verification.area_bound import bound_from_rest, swath_bound
from mpc_cover.verification.area_seen import area_seen
from mpc_cover.verification.connectivity import widest_bottleneck
from mpc_cover.verification.hovering import hovering_of
from mpc_cover.verification.information_summary import summarise_information
from mpc_cover.verification.losses import losses_of, segments, separations
from mpc_cover.verification.motion import taking_part
from mpc_cover.verification.path import Path
from mpc_cover.verification.separation import smallest_separation
from mpc_cover.verification.tolerance import tolerance_of

if TYPE_CHECKING:
    from mpc_cover.arrays import FloatArray
    from mpc_cover.trajectory_file import Recording
    from mpc_cover.verification.report import Report

_LEVELS = (90, 95, 99, 100)


@dataclass(frozen=True)
class StepTimes:
    """Durations of the controller's steps; a miss is a step longer than the period on the machine's clock."""

    steps: int
    p50_ms: float
    p99_ms: float
    max_ms: float
    period_ms: float
    misses: int


@dataclass(frozen=True)
class RunSummary:
    """The figures of a run; None is "never", "not asked for" or "does not apply".

    Attributes
    ----------
    covered_percent : by number of cells, as all percentages but that of the area; rounded down to a
        hundredth, so that 100 means all of it.
    time_to_90_s, ... : when that part of the cells was covered.
    smallest_separation_m : along the continuous path; None for a single agent.
    separation_min_m, communication_range_m : rho_B and rho_C.
    largest_speed_m_per_s, largest_input_m_per_s2 : those nearest their bounds, which are given beside them.
    connected : whether the fleet was connected at every instant, without agents lost by then; None where it was not
        asked for.
    bottleneck_m : the largest edge of its Euclidean minimum spanning tree at any instant.
    area_m2 : of the parts of W that matter, in `area_unit`: m^3 in space.
    area_seen_percent : how much of that area was in range at a sample, found by points that know nothing of the cells;
        rounded down to a tenth.
    time_apart_s : for how long it was not connected; the loss of a relay may be the reason.
    distance_m : travelled, by agent.
    swath_bound_s : T_b, about which no plan can be faster to cover everything.
    ratio_to_bound : time_to_99_s over T_b.
    bound_from_rest_s : the same with agents that start at rest and look at samples.
    hovering_agent_s : seconds, of all agents together, at rest while something was owed that they could have measured
        before anybody did, beyond what turning takes; None where more than a cell's first look matters.
    hovering_events : how often.
    information : what is left of looks, variances or ages; left out where one look settles a cell.
    """

    mission: str
    kind: str
    holds: bool
    violations: tuple[str, ...]
    duration_s: float
    cells: int
    covered_cells: int
    covered_percent: float
    time_to_90_s: float | None
    time_to_95_s: float | None
    time_to_99_s: float | None
    time_to_100_s: float | None
    smallest_separation_m: float | None
    separation_min_m: float | None
    connected: bool | None
    bottleneck_m: float | None
    communication_range_m: float | None
    largest_speed_m_per_s: float
    speed_max_m_per_s: float
    largest_input_m_per_s2: float
    input_max_m_per_s2: float
    distance_m: dict[str, float]
    distance_total_m: float
    swath_bound_s: float | None
    ratio_to_bound: float | None
    bound_from_rest_s: float | None
    step_times: StepTimes | None = None
    information: dict[str, Any] | None = None
    time_apart_s: float = 0.0
    hovering_agent_s: float | None = None
    hovering_events: int | None = None
    area_m2: float | None = None
    area_seen_percent: float | None = None
    area_unit: str = "m^2"

    def to_dict(self) -> dict[str, Any]:
        """Return the summary as plain data for `--json`."""
        data = asdict(self) | {"violations": list(self.violations)}
        if self.information is None:
            del data["information"]
        return data


def summarise(trajectory: Recording, report: Report, step_times: FloatArray | None = None) -> RunSummary:
    """Return a trajectory's summary; `step_times` are the controller's (S,) [s], if it is known."""
    mission, fleet = trajectory.mission, trajectory.mission.fleet
    path = Path(trajectory.time, trajectory.position, trajectory.velocity, trajectory.input)
    closest, longest = smallest_separation(path), _longest_edge(trajectory)
    asked = bool(np.isfinite(fleet.communication_range))
    torn = asked and longest is not None and longest > fleet.communication_range + tolerance_of(fleet)
    speed, speed_max = _nearest_bound(trajectory.velocity, fleet.speed_max)
    force, force_max = _nearest_bound(trajectory.input, fleet.input_max)
    reached = {level: time_to_cover(trajectory, level) for level in _LEVELS}
    look_s, hovering = look_interval(trajectory), hovering_of(trajectory)
    bound = swath_bound(mission, look_s)
    distance = distance_travelled(path)
    covered = int(np.isfinite(trajectory.covered_at).sum())
    return RunSummary(
        mission=mission.spec.name,
        kind=str(trajectory.meta.get("kind", "unknown")),
        holds=report.holds,
        violations=tuple(str(check) for check in report.failures),
        duration_s=float(trajectory.time[-1] - trajectory.time[0]),
        cells=mission.field.size,
        covered_cells=covered,
        covered_percent=floor_percent(covered, mission.field.size),
        time_to_90_s=reached[90],
        time_to_95_s=reached[95],
        time_to_99_s=reached[99],
        time_to_100_s=reached[100],
        smallest_separation_m=closest.value if closest else None,
        separation_min_m=fleet.separation_min or None,
        connected=not torn if asked and longest is not None else None,
        bottleneck_m=longest,
        communication_range_m=fleet.communication_range if asked else None,
        largest_speed_m_per_s=speed,
        speed_max_m_per_s=speed_max,
        largest_input_m_per_s2=force,
        input_max_m_per_s2=force_max,
        distance_m=dict(zip(fleet.ids, distance.tolist(), strict=True)),
        distance_total_m=float(distance.sum()),
        swath_bound_s=bound,
        ratio_to_bound=reached[99] / bound if bound and reached[99] is not None else None,
        bound_from_rest_s=bound_from_rest(mission, look_s),
        step_times=summarise_steps(step_times, time_for_a_step(trajectory)),
        information=summarise_information(trajectory),
        time_apart_s=_time_apart(trajectory) if torn else 0.0,
        hovering_agent_s=float(hovering.seconds.sum()) if hovering is not None else None,
        hovering_events=hovering.events if hovering is not None else None,
        area_m2=mission.field.measure,
        area_unit=f"m^{fleet.dimension}",
        area_seen_percent=math.floor(1e3 * seen + 1e-9) / 10.0 if (seen := area_seen(trajectory)) is not None else None,
    )


def floor_percent(part: int, whole: int, decimals: int = 2) -> float:
    """Return 100 part / whole rounded down, so that 99.96 % is never shown as 100 %."""
    scale: int = 10**decimals
    return (100 * scale * part // whole) / scale


def time_to_cover(trajectory: Recording, percent: int) -> float | None:
    """Return when [s] at least `percent` of the cells were covered; None if they never were."""
    cells = trajectory.covered_at.size
    needed = -(-percent * cells // 100)
    time = float(np.sort(trajectory.covered_at)[max(needed, 1) - 1])
    return time if math.isfinite(time) else None


def distance_travelled(path: Path) -> FloatArray:
    """Return (m,) [m]: the lengths of the continuous paths, by quadrature of the speed."""
    return np.asarray(sum(_lengths(piece) for piece in path.pieces()))


def _lengths(path: Path) -> FloatArray:
    node, weight = np.polynomial.legendre.leggauss(8)
    step = path.step
    elapsed = 0.5 * (node + 1.0) * step
    velocity = path.velocity[:-1, :, None] + elapsed[..., None] * path.force[:, :, None]
    speed = np.linalg.norm(velocity, axis=-1)
    return np.asarray(((speed * (0.5 * weight)).sum(axis=-1) * step[..., 0]).sum(axis=0))


def look_interval(trajectory: Recording) -> float:
    """Return the time between looks [s]: T_s of plans, the state period of flights; 0 of continuous sensing."""
    spec = trajectory.mission.spec
    if spec.sensing is Sensing.CONTINUOUS:
        return 0.0
    planned = trajectory.meta.get("kind") == RecordingKind.PLAN
    return spec.control.period_s if planned else spec.control.state_period_s


def time_for_a_step(trajectory: Recording) -> float:
    """Return how long a step of the controller may take on the machine's clock [s]: a period at the run's speed."""
    speed = trajectory.meta.get("speed", 1.0)
    usable = isinstance(speed, int | float) and math.isfinite(speed) and speed > 0.0
    return trajectory.mission.spec.control.period_s / (float(speed) if usable else 1.0)


def summarise_steps(step_times: FloatArray | None, period_s: float) -> StepTimes | None:
    """Return the percentiles of the (S,) step times [s]; None without any."""
    if step_times is None or step_times.size == 0:
        return None
    p50, p99 = np.percentile(1e3 * step_times, (50, 99))
    return StepTimes(
        steps=step_times.size,
        p50_ms=float(p50),
        p99_ms=float(p99),
        max_ms=float(1e3 * step_times.max()),
        period_ms=1e3 * period_s,
        misses=int((step_times > period_s).sum()),
    )


def _longest_edge(trajectory: Recording) -> float | None:
    """Return the longest edge [m] of the tree of agents not lost by then; None when there were never two."""
    paths = (taking_part(path, fleet)[0] for path, fleet in segments(trajectory, losses_of(trajectory)))
    widest = [edge.value for path in paths if (edge := widest_bottleneck(path)) is not None]
    return max(widest, default=None)


def _time_apart(trajectory: Recording) -> float:
    """Return for how long agents not lost by then were out of range of each other [s]."""
    end = float(trajectory.time[-1])
    apart = separations(trajectory, losses_of(trajectory), tolerance_of(trajectory.mission.fleet))
    return float(sum(min(one.end, end) - one.begin for one in apart))


def _nearest_bound(value: FloatArray, bound: FloatArray) -> tuple[float, float]:
    """Return the largest norm of (n, m, d) relative to its agent's bound (m,), and that bound."""
    norm = np.linalg.norm(value, axis=2)
    row, agent = np.unravel_index(int(np.argmax(norm / bound)), norm.shape)
    return float(norm[row, agent]), float(bound[agent])
