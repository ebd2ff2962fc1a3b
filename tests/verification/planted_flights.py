"""Small valid flights to plant violations in, and the tools of a forger who keeps all else consistent."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
from flights import leg, propagate, trajectory_of
from tiny_mission import TINY

from mpc_cover.information.replay import measured_at
from mpc_cover.mission.load import build_mission, mission_from_json
from mpc_cover.record_seal import sealed
from mpc_cover.service.run.simulate import simulate
from mpc_cover.service.run.swarm_simulate import fly_swarm

if TYPE_CHECKING:
    from mpc_cover.trajectory_file import Recording

FLEET = TINY["fleet"]
THREE = {
    **TINY,
    "name": "three",
    "fleet": {
        **FLEET,
        "agents": [*FLEET["agents"], {"id": "a3", "start_m": [1.5, 1.2]}],
        "communication_range_m": 1.9,
    },
}
VOLUME = {
    **TINY,
    "area": {"shape": {"kind": "box", "min_m": [0.0] * 3, "max_m": [2.0, 2.0, 1.5]}, "cell_size_m": 0.5},
    "fleet": {
        **FLEET,
        "agents": [{"id": "a1", "start_m": [0.5, 0.5, 0.5]}, {"id": "a2", "start_m": [1.5, 0.5, 0.5]}],
        "communication_range_m": 2.0,
    },
}
KINDS = {
    "three": THREE,
    "looks": {**TINY, "information": {"kind": "looks", "looks": 2}},
    "effective": {**TINY, "information": {"kind": "effective", "level": 1.5}},
    "continuous": {**TINY, "sensing": "continuous"},
    "patrol": {
        **TINY,
        "information": {"kind": "ageing", "age_limit_s": 12.0, "strict": True},
        "control": {"time_limit_s": 8.0},
    },
    "volume": VOLUME,
}


@cache
def flown(kind="three", deaths=()) -> Recording:
    """Return a simulated flight: of a kind of mission, with deaths as (id, time [s])."""
    return simulate(build_mission(KINDS[kind], kind), deaths=dict(deaths)).trajectory


def bereaved() -> Recording:
    """Return the flight of three of whom the third dies."""
    return flown("three", (("a3", 1.2),))


def edited(recording: Recording, **sections) -> Recording:
    """Return the recording with other keys in its mission, by section; without one, at the top."""
    return replace(recording, mission=mission_with(recording.mission, **sections))


def mission_with(mission, **sections):
    """Return the mission with other keys."""
    spec = mission.spec.model_dump(mode="json", by_alias=True, exclude_none=True)
    for section, keys in sections.items():
        adds = isinstance(keys, dict) and section in {"area", "fleet", "planning", "control"}
        spec[section] = {**spec.get(section, {}), **keys} if adds else keys
    return build_mission(spec, "edited")


def agents_with(mission, **keys):
    """Return the mission with other keys of every agent, each a value or a function of the agent's."""
    agents = [agent.model_dump(mode="json", exclude_none=True) for agent in mission.spec.fleet.agents]
    for agent in agents:
        agent.update({key: value(agent) if callable(value) else value for key, value in keys.items()})
    return mission_with(mission, fleet={"agents": agents})


def claimed_anew(recording: Recording) -> Recording:
    """Return the recording with the coverage that its motion gives, the dead's included."""
    arrays = (recording.time, recording.position, recording.velocity)
    return replace(recording, covered_at=measured_at(recording.mission, *arrays), cell=recording.mission.field.cell)


def reflown(recording: Recording, force, *, start=None, velocity=None) -> Recording:
    """Return the motion of other inputs at the same times, its coverage claimed honestly."""
    start = recording.position[0] if start is None else start
    velocity = recording.velocity[0] if velocity is None else velocity
    position, velocity = propagate(start, force, recording.time, velocity)
    return claimed_anew(replace(recording, position=position, velocity=velocity, input=force))


def split(recording: Recording, parts: int) -> Recording:
    """Return the same motion with so many samples for each."""
    step = np.diff(recording.time)
    part = np.arange(parts) / parts
    time = np.append((recording.time[:-1, None] + part * step[:, None]).ravel(), recording.time[-1])
    position, velocity = recording.at(time, 0.0)
    return replace(
        recording, time=time, position=position, velocity=velocity, input=np.repeat(recording.input, parts, axis=0)
    )


def copied(recording: Recording, number=np.float32) -> Recording:
    """Return a copy whose numbers went through another type."""
    names = ("time", "position", "velocity", "input", "cell", "covered_at")
    return replace(recording, **{name: getattr(recording, name).astype(number).astype(float) for name in names})


def thinned(recording: Recording) -> Recording:
    """Return the recording without the samples at which no input changes, its claims as they were.

    The input of single integrators is their velocity.
    """
    single = recording.mission.spec.fleet.dynamics == "single"
    held = recording.velocity[:-1] if single else recording.input
    change = np.abs(np.diff(held, axis=0)).max(axis=(1, 2)) > 0.0
    keep = np.concatenate([[True], change, [True]])
    names = ("time", "position", "velocity")
    kept = {name: getattr(recording, name)[keep] for name in names}
    return replace(recording, **kept, input=recording.input[keep[:-1]])


def later(recording: Recording, seconds: float) -> Recording:
    """Return the recording on a clock that is ahead by so many seconds."""
    lost = {name: time + seconds for name, time in recording.meta.get("lost", {}).items()}
    meta = {**recording.meta, **({"lost": lost} if lost else {})}
    return replace(recording, time=recording.time + seconds, covered_at=recording.covered_at + seconds, meta=meta)


@cache
def single() -> Recording:
    """Return a flight of single integrators by the distributed law."""
    raw = {**TINY, "fleet": {**FLEET, "dynamics": "single", "communication_range_m": 4.0}}
    return fly_swarm(build_mission(raw, "single")).trajectory


def renumbered(recording: Recording, order) -> Recording:
    """Return the recording with its agents in another order, in the mission and in every array."""
    agents = [recording.mission.spec.fleet.agents[i].model_dump(mode="json", exclude_none=True) for i in order]
    arrays = {name: getattr(recording, name)[:, list(order)] for name in ("position", "velocity", "input")}
    mission = mission_with(recording.mission, fleet={"agents": agents})
    return replace(recording, **arrays, mission=mission, agent_id=mission.fleet.ids)


def moved(recording: Recording, offset) -> Recording:
    """Return the same flight elsewhere, by an offset (d,) [m]."""
    shape = recording.mission.spec.area.shape
    where = {"kind": "box", "min_m": (np.array(shape.min_m) + offset).tolist()}
    where["max_m"] = (np.array(shape.max_m) + offset).tolist()
    agents = [agent.model_dump(mode="json", exclude_none=True) for agent in recording.mission.spec.fleet.agents]
    for agent in agents:
        agent["start_m"] = (np.array(agent["start_m"]) + offset).tolist()
    mission = mission_with(recording.mission, area={"shape": where}, fleet={"agents": agents})
    moved = replace(recording, position=recording.position + offset, mission=mission, cell=mission.field.cell)
    return replace(moved, position=np.concatenate([mission.fleet.start[None], moved.position[1:]]))


@cache
def legs(kind="simulate", **planning) -> Recording:
    """Return a there-and-back of the three, 0.5 m up and down again, as a flight or a plan."""
    mission = mission_with(build_mission(THREE, "three"), **({"planning": planning} if planning else {}))
    up = np.tile([0.0, 0.5], (3, 1))
    period = mission.spec.control.period_s
    return trajectory_of(mission, np.concatenate([leg(up, period, 2, 2), leg(-up, period, 2, 2)]), kind)


@cache
def torn(lost=()) -> Recording:
    """Return three in a row; from 2 s on the two on the left fly out of the third's range, who rests. Lost by id."""
    agents = [{"id": f"a{i + 1}", "start_m": [1.5 + i, 0.5]} for i in range(3)]
    raw = {
        **TINY,
        "area": {"shape": {"kind": "box", "min_m": [0.0, 0.0], "max_m": [6.0, 3.0]}, "cell_size_m": 0.5},
        "fleet": {**FLEET, "agents": agents, "communication_range_m": 1.25},
    }
    mission = build_mission(raw, "torn")
    force = np.zeros((10, 3, 2))
    force[4:6, :2, 0], force[6:8, :2, 0] = -0.7, 0.7
    flight = trajectory_of(mission, force)
    return replace(flight, meta={**flight.meta, "lost": dict(lost)})


def written() -> Recording:
    """Return the flight of three as a real one: sealed."""
    return sealed(replace(bereaved(), meta={**bereaved().meta, "kind": "demo", "speed": 1.0}))


def as_it_is_read(recording: Recording) -> Recording:
    """Return the recording with its mission as a file gives it back."""
    return replace(recording, mission=mission_from_json(recording.mission.to_json(), "the file"))
