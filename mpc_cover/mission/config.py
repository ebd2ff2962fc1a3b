"""A mission as the user writes it: frozen pydantic models, units in the field names.

Nothing here computes; `field.py` and `fleet.py` turn these models into arrays.
"""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated, Literal

from pydantic import AfterValidator, BeforeValidator, Field

from mpc_cover.mission.base import Finite, Model, Name, NonNegative, Point, Positive, no_flag
from mpc_cover.mission.information import (
    AgeingInformation,
    EffectiveInformation,
    Information,
    InformationKind,
    KalmanInformation,
    LookInformation,
)
from mpc_cover.mission.potential_spec import PotentialSpec

SCHEMA_VERSION = 1


class Dynamics(StrEnum):
    """How agents move."""

    DOUBLE = "double"
    """Double integrators (3.1)."""
    SINGLE = "single"
    """Single integrators (5.1), whose u_max is `speed_max_m_per_s`: these fly by the potential law only."""


class Sensing(StrEnum):
    """When sensors look."""

    SAMPLED = "sampled"
    """At instants: plans count on their samples (4.34), agents look whenever they report."""
    CONTINUOUS = "continuous"
    """All the time: whatever the path passes within the sensing radius is measured."""


class PlanStart(StrEnum):
    """How offline plans start."""

    FIXED = "fixed"
    """At rest at `start_m`."""
    FREE = "free"
    """In any state (3.15)."""


class PlanEnd(StrEnum):
    """How offline plans end."""

    REST = "rest"
    """At rest anywhere."""
    FREE = "free"
    """In any state."""
    FIXED = "fixed"
    """At rest at `end_m`."""
    CLOSED = "closed"
    """In the state that the plan starts from."""


class BoxShape(Model):
    """An axis-aligned box, in two or three dimensions."""

    kind: Literal["box"]
    min_m: Point
    max_m: Point


class DiscShape(Model):
    """A disc (a ball when the centre has three coordinates)."""

    kind: Literal["disc"]
    center_m: Point
    radius_m: Positive


def _planar(ring: tuple[Point, ...]) -> tuple[Point, ...]:
    return tuple(point[:2] for point in ring)


Ring = Annotated[tuple[Point, ...], Field(min_length=3), AfterValidator(_planar)]


class PolygonShape(Model):
    """A simple polygon with holes; agents may cross what lies outside it.

    A third coordinate, as GeoJSON's altitude, is left out: the polygon is planar.
    """

    kind: Literal["polygon"]
    outline_m: Ring
    holes_m: tuple[Ring, ...] = ()


class WeightMap(Model):
    """Cell weights from an array (`.npy`) or an image (grey: black 0 to white 1), stretched over W's bounding box.

    Arrays are indexed [x, y] from the lower corner; images are seen as printed, y upward. Cells of weight 0
    need not be measured.
    """

    file: str | None = None
    """Relative to the mission file; what it holds takes the place of `values` when the mission is read."""
    values: Annotated[tuple[tuple[NonNegative, ...], ...], Field(min_length=1)] | None = None
    """Rows along x, columns along y."""


Shape = Annotated[BoxShape | DiscShape | PolygonShape, Field(discriminator="kind")]


class Area(Model):
    """The set of interest W, cut into square cells (thesis 3.2.2)."""

    shape: Shape
    cell_size_m: Positive
    motion_min_m: Point | None = None
    """Lower corner of the box that agents stay in (3.14); default: W's bounding box."""
    motion_max_m: Point | None = None
    """Upper corner of the box that agents stay in (3.13); default: W's bounding box."""
    looks: Annotated[int, Field(ge=1, le=100)] = 1
    """K: how often each cell must be looked at (K-coverage, 5.2.1). A look is one agent's; its next look at the same
    cell counts a period later."""
    weights: WeightMap | None = None
    """How much each cell matters; left out, all the same."""


Radius = Positive | Annotated[dict[Name, Positive], Field(min_length=1)]


class AgentSpec(Model):
    """One agent; what it leaves out comes from `fleet.defaults`."""

    id: Name
    start_m: Point
    sensing_radius_m: Radius | None = None
    input_max_m_per_s2: Positive | None = None
    speed_max_m_per_s: Positive | None = None
    mass_kg: Positive | None = None
    force_max_n: Positive | None = None
    """With `mass_kg`, another way to bound the input: force over mass (3.1 with a mass other than one)."""
    end_m: Point | None = None
    """Where a plan with `planning.end: fixed` ends."""


class AgentDefaults(Model):
    """Values of all agents that give none of their own."""

    sensing_radius_m: Radius | None = None
    input_max_m_per_s2: Positive | None = None
    speed_max_m_per_s: Positive | None = None
    mass_kg: Positive | None = None
    force_max_n: Positive | None = None


class FleetSpec(Model):
    """The agents and the constraints between them (4.18, 4.20)."""

    defaults: AgentDefaults = AgentDefaults()
    agents: Annotated[tuple[AgentSpec, ...], Field(min_length=1, max_length=256)]
    separation_min_m: NonNegative = 0.0
    """rho_B of (4.18); 0 switches collision avoidance off."""
    communication_range_m: Positive | None = None
    """rho_C of (4.20); left out, connectivity is not asked for."""
    links: tuple[tuple[Name, Name], ...] = ()
    """Pairs that always stay within range of each other: fixed topology (4.19)."""
    faults_tolerated: Annotated[int, Field(ge=0)] = 0
    """h: everything is covered even if any h agents fail from the start (robustness, section 4.1)."""
    dynamics: Dynamics = Dynamics.DOUBLE


class Control(Model):
    """The sampled-data controller."""

    period_s: Positive = 0.5
    """T_s of (4.23), and the period of the receding horizon."""
    horizon_steps: Annotated[int, Field(ge=2, le=400)] = 20
    deadline_fraction: Annotated[float, Field(gt=0, le=0.9)] = 0.5
    """Part of the period that a control step may take before it falls back to the next best plan."""
    improvement_share: Annotated[float, Field(ge=0, le=0.9)] = 0.6
    """Part of the period in which the rest of the plan may be improved after a control step; 0 for none."""
    planning_time_s: Positive = 6.0
    """Bound on the thorough planning before the start, while the fleet is at rest; doubled, up to eightfold, whenever
    it was too short for a plan worth flying."""
    time_limit_s: Positive = 600.0
    """Mission time after which the controller gives up and reports a failure."""
    state_period_s: Positive = 0.1
    """How often agents measure and report."""
    plan_step_s: Positive | None = None
    """Time between the samples of plans, a multiple of the period; default: the period."""

    @property
    def plan_step(self) -> float:
        """Time between the samples of plans [s]."""
        return self.period_s * self.substeps

    @property
    def substeps(self) -> int:
        """Periods of control in a step of plans."""
        return 1 if self.plan_step_s is None else max(1, round(self.plan_step_s / self.period_s))

    @property
    def inbox_s(self) -> float:
        """How often agents read their plans [s]: as they report, or so often that plans made in time come in time."""
        return min(self.state_period_s, 0.5 * (1.0 - self.deadline_fraction) * self.period_s)

    @property
    def horizon_periods(self) -> int:
        """Length of the horizon in periods of control."""
        return self.horizon_steps * self.substeps

    @property
    def horizon_s(self) -> float:
        """Length of the horizon [s]."""
        return self.horizon_periods * self.period_s


class Planning(Model):
    """One offline solve (`mpc-cover plan`)."""

    duration_s: Positive | None = None
    """Of the plan; left out, as long as it takes to cover everything."""
    start: PlanStart = PlanStart.FIXED
    end: PlanEnd = PlanEnd.REST


class Disturbance(Model):
    """Bounds on the disturbances of simulated agents; the controller's margins are derived from them."""

    position_noise_m: NonNegative = 0.0
    """Measured positions are off by at most this, uniformly in a ball."""
    input_noise_m_per_s2: NonNegative = 0.0
    """Accelerations are off by at most this, uniformly in a ball, anew each state period."""
    wind_m_per_s2: Annotated[tuple[Finite, ...], Field(max_length=3)] = ()
    """A constant acceleration that acts on all agents."""
    delay_s: NonNegative = 0.0
    """Delay with which states reach the controller, at most a period."""
    slow_agents: dict[Name, Annotated[float, Field(gt=0, le=1)]] = Field(default_factory=dict)
    """Agents that reach only this part of their speed limit, without knowing it."""


class MissionSpec(Model):
    """A whole mission file."""

    schema_version: Annotated[Literal[1], BeforeValidator(no_flag)] = Field(alias="schema")
    name: Name
    area: Area
    fleet: FleetSpec
    magnitudes: Annotated[tuple[Name, ...], Field(min_length=1)] = ("coverage",)
    """The magnitudes to be measured everywhere (Xi of 4.1); radii may differ for each."""
    sensing: Sensing = Sensing.SAMPLED
    """When sensors look: at instants, or all the time."""
    information: Information | None = None
    """When a cell counts as measured (5.2.1); left out, by one look, or by `area.looks`."""
    control: Control = Control()
    planning: Planning = Planning()
    disturbance: Disturbance = Disturbance()
    potential: PotentialSpec = PotentialSpec()

    @property
    def information_kind(self) -> InformationKind:
        """What "measured" means."""
        if self.information is not None:
            return InformationKind(self.information.kind)
        return InformationKind.LOOKS if self.area.looks > 1 else InformationKind.COVERAGE

    @property
    def looks(self) -> int:
        """K of K-coverage: how many looks each cell needs, each adding the same; 1 for the other kinds."""
        given = self.information
        return given.looks if isinstance(given, LookInformation) else self.area.looks

    @property
    def looks_again(self) -> bool:
        """Whether more than a cell's first look matters."""
        several = EffectiveInformation | KalmanInformation | AgeingInformation
        return self.looks > 1 or isinstance(self.information, several)
