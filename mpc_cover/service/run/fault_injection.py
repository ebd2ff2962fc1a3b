"""Fault injection: agents that the user wants to be killed in flight, `--kill a2@6.5`."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from mpc_cover.errors import InvalidInputError, Problem

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from mpc_cover.mission.load import Mission


def parse_kills(values: Sequence[str], mission: Mission) -> dict[str, float]:
    """Return the mission times [s] at which agents are killed, by id, from values like a2@6.5.

    Raises
    ------
    InvalidInputError
        A value is malformed, or the deaths are impossible, see `check_deaths`.
    """
    problems: list[Problem] = []
    deaths: dict[str, float] = {}
    for value in values:
        name, at, text = value.rpartition("@")
        try:
            time_s = float(text)
        except ValueError:
            time_s = math.nan
        if not at or not name or math.isnan(time_s):
            problems.append(Problem("--kill", value, "must be AGENT@SECONDS, as a2@6.5"))
        elif name in deaths:
            problems.append(Problem("--kill", value, f"{name} dies once only"))
        else:
            deaths[name] = time_s
    problems += _impossible(deaths, mission, "--kill")
    if problems:
        raise InvalidInputError("deaths", problems)
    return deaths


def check_deaths(deaths: Mapping[str, float], mission: Mission) -> None:
    """Raise InvalidInputError for unknown agents, deaths before the take-off, or when no agent is left."""
    if problems := list(_impossible(deaths, mission, "deaths")):
        raise InvalidInputError("deaths", problems)


def _impossible(deaths: Mapping[str, float], mission: Mission, where: str) -> Iterator[Problem]:
    ids = mission.fleet.ids
    for name, time_s in deaths.items():
        if name not in ids:
            yield Problem(where, f"{name}@{time_s:g}", f"there is no {name}: agents are {', '.join(ids)}")
        if not (math.isfinite(time_s) and time_s > 0.0):
            right = "must be a mission time later than 0 s: before the take-off everyone is waited for"
            yield Problem(where, f"{name}@{time_s:g}", right)
    if set(ids) <= set(deaths):
        yield Problem(where, ", ".join(deaths), "somebody must be left")
