"""The parts of `mpc-cover study thesis`: each flies or plans one mission, and draws its figures."""

from __future__ import annotations

import shlex
from dataclasses import dataclass
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from mpc_cover.mission.load import load_mission, shipped_missions
from mpc_cover.studies.fleet_sizing import SizingProblem, measurement_rate
from mpc_cover.studies.sizing_simulation import coverage_curves
from mpc_cover.studies.swarm_mission import fly_mission
from mpc_cover.verification.summary import floor_percent
from mpc_cover.view import swarm_figures
from mpc_cover.view.sizing_figures import figure_1_1, figure_1_2
from mpc_cover.view.style import house_style, save_figure

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from matplotlib.figure import Figure

    from mpc_cover.studies.swarm_record import SwarmRecord

AREA = SizingProblem(area_m2=100.0, radius_m=1.0, speed_m_per_s=1.5)
"""The thesis does not give the area of figures 1.1 and 1.2; this is a choice."""


class Panel(msgspec.Struct, frozen=True):
    """A figure: its number in the thesis, or a name where it has none; its file, title and facts about it."""

    number: str
    file: str
    title: str
    facts: list[str] = []


class PartResult(msgspec.Struct, frozen=True, kw_only=True):
    """The result of a part: its figures, the command that made them, and problems found."""

    key: str
    chapter: int
    panels: list[Panel]
    command: str
    problems: list[str] = []
    stamp: str = ""


@dataclass(frozen=True)
class Part:
    """A part of the study.

    Attributes
    ----------
    key : mission, or "sizing".
    figures : numbers of the figures in the thesis.
    make : flies or plans, and draws into a folder, with a seed.
    mission : the mission file; None for the sizing model.
    """

    key: str
    chapter: int
    figures: tuple[str, ...]
    make: Callable[[Part, Path, int], PartResult]
    mission: Path | None = None

    def names(self) -> tuple[str, ...]:
        """Return the names by which this part can be selected."""
        return (self.key, *self.figures)


_SWARM = {
    "fig-5-1": ("5.1", "5.2"),
    "fig-5-3": ("5.3", "5.4"),
    "fig-6-2": ("6.2", "6.3"),
    "fig-6-4": ("6.4", "6.5"),
}


def all_parts() -> list[Part]:
    """Return the parts, in the order of the thesis."""
    shipped = shipped_missions()
    offline = sorted(path for path in shipped if path.parent.name == "thesis")
    swarm = sorted(path for path in shipped if path.parent.name == "thesis-potential" and path.stem in _SWARM)
    parts = [Part("sizing", 1, ("1.1", "1.2"), _sizing)]
    parts += [Part(path.stem, _chapter_of(path.stem), _figures_of(path.stem), _offline, path) for path in offline]
    parts += [Part(path.stem, _chapter_of(path.stem), _SWARM[path.stem], _distributed, path) for path in swarm]
    return sorted(parts, key=lambda part: (part.chapter, not part.figures, part.figures, part.key))


def _figures_of(stem: str) -> tuple[str, ...]:
    """Return the figure that a mission is named after: fig-3-1 is 3.1."""
    return (stem.removeprefix("fig-").replace("-", "."),) if stem.startswith("fig-") else ()


def _chapter_of(stem: str) -> int:
    """Return the chapter; missions without a number are of chapter 4."""
    return int(stem.split("-")[1]) if stem.startswith("fig-") else 4


def _sizing(part: Part, folder: Path, seed: int) -> PartResult:
    curves = coverage_curves(AREA, seeds=range(seed, seed + 10))
    agents = np.arange(1.0, 21.0)
    rate = np.array([measurement_rate(AREA, int(number)) for number in agents])
    facts = [f"N = {c.agents}: mean absolute error of the model {100.0 * c.error.mean_absolute:.1f} %" for c in curves]
    rates = [
        f"N = {c.agents}: {measurement_rate(AREA, c.agents):.3f} Hz by the model, {c.rate_hz:.3f} Hz simulated"
        for c in curves
    ]
    with house_style():
        files = [save_figure(figure_1_1(curves), folder / "1-1.png").name]
        files += [save_figure(figure_1_2(agents, rate, AREA.cover, curves), folder / "1-2.png").name]
    size = f"--area {AREA.area_m2:g} --radius {AREA.radius_m:g} --speed {AREA.speed_m_per_s:g} --cover {AREA.cover:g}"
    panels = [
        Panel("1.1", files[0], "Coverage over time, model and simulations", facts),
        Panel("1.2", files[1], "Rate of measurement", rates),
    ]
    return PartResult(key=part.key, chapter=1, panels=panels, command=f"mpc-cover size {size} --out size")


def _offline(part: Part, folder: Path, seed: int) -> PartResult:
    """Plan a mission of chapters 3 and 4 and draw it."""
    from mpc_cover.planning.offline import PlanOptions, plan_mission  # noqa: PLC0415 - heavy, and not for all parts
    from mpc_cover.verification.check import check_trajectory  # noqa: PLC0415 - likewise
    from mpc_cover.verification.summary import summarise  # noqa: PLC0415 - likewise
    from mpc_cover.view.figures import draw_run  # noqa: PLC0415 - likewise

    mission = load_mission(str(part.mission))
    trajectory = plan_mission(mission, PlanOptions(seed=seed), on_progress=lambda _: None)
    report = check_trajectory(trajectory)
    summary = summarise(trajectory, report)
    files = [path.name for path in draw_run(trajectory, folder, None, report)]
    shown = [name for name in files if name == "overview.png" or name.startswith("map-")]
    facts = [
        f"covered {summary.covered_percent:g} % in {summary.duration_s:g} s, J = {trajectory.meta['cost_m']:.3g} m",
        "verified along the continuous path" if report.holds else f"VIOLATED: {'; '.join(summary.violations)}",
    ]
    number = part.figures[0] if part.figures else part.key
    titles = {name: mission.spec.name if name == "overview.png" else name.removesuffix(".png") for name in shown}
    panels = [Panel(number, name, titles[name], facts if name == "overview.png" else []) for name in shown]
    name = shlex.quote(part.key)
    command = f"mpc-cover plan {name} --seed {seed} --out {name}.npz && mpc-cover plot {name}.npz"
    problems = [f"{part.key}: {violation}" for violation in summary.violations]
    return PartResult(key=part.key, chapter=part.chapter, panels=panels, command=command, problems=problems)


def _distributed(part: Part, folder: Path, seed: int) -> PartResult:
    """Fly a mission of chapters 5 and 6 and draw it; with a delay, the same under global knowledge, too."""
    mission = load_mission(str(part.mission))
    own = fly_mission(mission, seed, maps_every=1)
    delayed = own.parameters.delay != 0
    informed = fly_mission(mission, seed, delay=0) if delayed else own
    with house_style():
        figures = _swarm_figures(part.key, own, informed)
        files = [save_figure(figure, folder / f"{number}.png").name for number, figure in figures]
    facts = facts_of(own)
    if delayed:
        facts.append(f"global knowledge: everything measured after {informed.time_to_cover:.1f} s")
    titles = [str(figure.get_suptitle()) or mission.spec.name for _, figure in figures]
    panels = [
        Panel(number, file, title, facts if place == 0 else [])
        for place, ((number, _), file, title) in enumerate(zip(figures, files, titles, strict=True))
    ]
    command = f"mpc-cover study thesis --only {part.key} --seed {seed} --out thesis"
    problems = [f"{part.key}: {problem}" for problem in problems_of(own)]
    return PartResult(key=part.key, chapter=part.chapter, panels=panels, command=command, problems=problems)


def _swarm_figures(key: str, own: SwarmRecord, informed: SwarmRecord) -> list[tuple[str, Figure]]:
    match key:
        case "fig-5-1":
            return [("5.1", swarm_figures.figure_5_1(own)), ("5.2", swarm_figures.figure_5_2(own))]
        case "fig-5-3":
            return [("5.3", swarm_figures.figure_5_3(own)), ("5.4", swarm_figures.figure_5_4(own))]
        case "fig-6-2":
            return [("6.2", swarm_figures.figure_6_2(own)), ("6.3", swarm_figures.figure_6_3(own, informed))]
        case _:
            return [("6.4", swarm_figures.figure_6_4(own, informed)), ("6.5", swarm_figures.figure_6_5(own))]


def facts_of(record: SwarmRecord) -> list[str]:
    """Return facts about a run of the distributed law, as sentences."""
    cells, left = record.covered_at.size, int(np.isinf(record.covered_at).sum())
    facts = [f"measured {floor_percent(cells - left, cells):g} % of {cells} cells"]
    if left == 0:
        facts[0] += f", the last after {record.time_to_cover:.1f} s; everyone knew after {record.time_to_know:.1f} s"
    fleet = record.fleet
    if fleet.separation_min > 0.0:
        facts.append(f"closest at any instant {record.closest:.3f} m of {fleet.separation_min:g} m")
    if np.isfinite(fleet.communication_range):
        facts.append(f"connected at any instant within {record.bottleneck:.3f} m of {fleet.communication_range:g} m")
    return facts


def problems_of(record: SwarmRecord) -> list[str]:
    """Return the problems of a run of the distributed law; checked along the continuous path."""
    fleet, tolerance = record.fleet, 1e-6
    problems = [] if record.covered else ["not everything was measured"]
    if fleet.separation_min > 0.0 and record.closest < fleet.separation_min - tolerance:
        problems.append(f"two agents came within {record.closest:.4f} m")
    if np.isfinite(fleet.communication_range) and record.bottleneck > fleet.communication_range + tolerance:
        problems.append(f"the fleet was connected within {record.bottleneck:.4f} m only")
    return problems
