"""What violations are planted with."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from planted_flights import THREE, claimed_anew, leg, legs, mission_with, propagate

from mpc_cover.mission.load import build_mission


def changed(recording, name, index, value):
    """Return the recording with other numbers at an index of an array."""
    array = getattr(recording, name).copy()
    array[index] = value(array[index]) if callable(value) else value
    return replace(recording, **{name: array})


def at_samples(recording, keep):
    """Return the recording with these samples, by index, the inputs as they follow each."""
    kept = {name: getattr(recording, name)[keep] for name in ("time", "position", "velocity")}
    return replace(recording, **kept, input=recording.input[np.minimum(keep[:-1], len(recording.input) - 1)])


def along(start, forces, kind="simulate", **sections):
    """Return the flight of three from their starts (3, 2) [m], one input (3, 2) a period, in a wider mission."""
    agents = [{"id": f"a{i + 1}", "start_m": list(place)} for i, place in enumerate(start)]
    raw = {**THREE, "fleet": {**THREE["fleet"], "agents": agents, "communication_range_m": 3.0}}
    mission = mission_with(build_mission(raw, "along"), **sections)
    time = mission.spec.control.period_s * np.arange(len(forces) + 1)
    position, velocity = propagate(mission.fleet.start, np.array(forces, dtype=float), time)
    blank = legs(kind)
    flight = replace(blank, time=time, position=position, velocity=velocity, input=np.array(forces, dtype=float))
    return claimed_anew(replace(flight, mission=mission, agent_id=mission.fleet.ids))


def meta(recording, **facts):
    return replace(recording, meta={**recording.meta, **facts})


def lost(recording, **times):
    return meta(recording, lost=times)


def check_by(recording, mission):
    """Return the recording that is to be judged by this mission, as its own is laxer."""
    return recording, mission


def range_of(recording, reach):
    return mission_with(recording.mission, fleet={"communication_range_m": reach})


def linked(recording):
    return mission_with(recording.mission, fleet={"links": [["a2", "a3"]]})


def near():
    """Return inputs with which the outer two come too near to the middle one."""
    return leg([[0.45, 0.0], [0.0, 0.0], [0.0, 0.0]], 0.5, 2, 2)


def cut(recording, samples):
    return claimed_anew(at_samples(recording, np.arange(samples)))
