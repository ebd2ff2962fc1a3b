"""Judges a recording by a mission of the reader's own, whatever mission its file holds."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from mpc_cover.errors import InvalidInputError, Problem

if TYPE_CHECKING:
    from collections.abc import Iterator

    from mpc_cover.mission.load import Mission
    from mpc_cover.trajectory_file import Recording

_SHOWN = 40
"""Characters of a value that a difference shows; a plain choice."""


def judged_by(trajectory: Recording, mission: Mission) -> Recording:
    """Return the recording with this mission in place of its own, and its agents in the mission's order.

    Raises
    ------
    InvalidInputError
        The mission is of other agents, or of other dimensions, than the recording.
    """
    ids, given = trajectory.agent_id, mission.fleet.ids
    problems = []
    if sorted(ids) != sorted(given):
        problems.append(Problem("agents", list(ids), f"must be those of mission {mission.spec.name}: {list(given)}"))
    if trajectory.position.shape[-1] != mission.fleet.dimension:
        dimensions = trajectory.position.shape[-1]
        problems.append(Problem("dimensions", dimensions, f"must be {mission.fleet.dimension}, as the mission's"))
    if problems:
        raise InvalidInputError(f"trajectory of mission {trajectory.mission.spec.name}", problems)
    order = np.array([ids.index(name) for name in given])
    return replace(
        trajectory,
        position=trajectory.position[:, order],
        velocity=trajectory.velocity[:, order],
        input=trajectory.input[:, order],
        agent_id=given,
        mission=mission,
    )


def differences(held: Mission, given: Mission) -> list[str]:
    """Return where a mission that a file holds differs from another one, each with both values; agents by their ids."""
    theirs, ours = (dict(_leaves("", _by_id(json.loads(mission.to_json())))) for mission in (held, given))
    found = []
    for path in dict.fromkeys([*ours, *theirs]):
        there, here = (_text(side.get(path)) for side in (theirs, ours))
        if theirs.get(path) != ours.get(path):
            found.append(f"{path}: {there} in the file, {here} in the mission given")
    return found


def _by_id(spec: dict[str, Any]) -> dict[str, Any]:
    """Return a specification whose agents are keyed by their ids: their order is no difference."""
    agents = {agent["id"]: agent for agent in spec["fleet"]["agents"]}
    return {**spec, "fleet": {**spec["fleet"], "agents": agents}}


def _leaves(path: str, value: Any) -> Iterator[tuple[str, Any]]:
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from _leaves(f"{path}.{key}" if path else str(key), inner)
    else:
        yield path, value


def _text(value: Any) -> str:
    text = "nothing" if value is None else json.dumps(value)
    return text if len(text) <= _SHOWN else f"{text[: _SHOWN - 3]}..."
