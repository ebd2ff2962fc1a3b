"""Reading missions: YAML in, a validated mission with its arrays out."""

from __future__ import annotations

import contextlib
import re
from dataclasses import dataclass, replace
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import yaml
from pydantic import ValidationError

from mpc_cover.errors import InvalidInputError, Problem, UnreadableFileError
from mpc_cover.mission.config import MissionSpec
from mpc_cover.mission.field import Field, bounding_box, build_field
from mpc_cover.mission.fleet import Fleet, build_fleet
from mpc_cover.mission.validation import find_problems
from mpc_cover.mission.validation_errors import problems_of
from mpc_cover.mission.weights import with_weights

if TYPE_CHECKING:
    from collections.abc import Hashable


@dataclass(frozen=True, eq=False)
class Mission:
    """A validated mission: the specification and the arrays built from it."""

    spec: MissionSpec
    field: Field
    fleet: Fleet

    def to_json(self) -> str:
        """Return the whole specification as JSON; `mission_from_json` reads it back."""
        return self.spec.model_dump_json(by_alias=True, exclude_none=True)


class _StrictLoader(yaml.SafeLoader):
    """YAML without silently overwritten keys."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Hashable, Any]:
        seen = set()
        for key_node, _ in node.value:
            if key_node.tag == "tag:yaml.org,2002:merge":
                continue  # `<<: *defaults`, whose keys may be overridden
            key = self.construct_object(key_node, deep=True)
            if key in seen:
                mark = key_node.start_mark
                raise yaml.constructor.ConstructorError(None, None, f"duplicate key {key!r}", mark)
            seen.add(key)
        return super().construct_mapping(node, deep)


def build_mission(raw: object, what: str) -> Mission:
    """Validate raw data and build its arrays.

    Raises
    ------
    InvalidInputError
        Every mistake at once, each with its path, the value and what would be right.
    """
    try:
        spec = MissionSpec.model_validate(raw)
    except ValidationError as error:
        problems = problems_of(error, raw)
        problems += _cross_field_problems(raw, problems)
        raise InvalidInputError(what, _named(problems, raw)) from None
    if problems := find_problems(spec):
        raise InvalidInputError(what, _named(problems, raw))
    lower, upper = bounding_box(spec.area.shape)
    motion_min = np.array(spec.area.motion_min_m) if spec.area.motion_min_m else lower
    motion_max = np.array(spec.area.motion_max_m) if spec.area.motion_max_m else upper
    return Mission(spec, build_field(spec.area), build_fleet(spec, motion_min, motion_max))


def load_mission(path: str | Path) -> Mission:
    """Read a mission file; a bare name such as `box-3` is that of a mission of the package.

    Raises
    ------
    UnreadableFileError
        The file is missing or is not YAML.
    InvalidInputError
        The mission has mistakes.
    """
    file = _find(Path(path))
    try:
        text = file.read_text(encoding="utf-8")
        raw = yaml.load(text, Loader=_StrictLoader)  # noqa: S506 - a SafeLoader
    except OSError as error:
        raise UnreadableFileError(f"mission {path}: cannot be read: {error.strerror or error}") from None
    except UnicodeDecodeError as error:
        raise UnreadableFileError(f"mission {path}: cannot be read: is not UTF-8 text: {error}") from None
    except Exception as error:  # noqa: BLE001 - besides its own, PyYAML lets through what its constructors raise
        detail = " ".join(str(error).split())
        raise UnreadableFileError(f"mission {path}: is not valid YAML: {detail}") from None
    return build_mission(with_weights(raw, file.parent, f"mission {path}"), f"mission {path}")


def mission_from_json(text: str, what: str) -> Mission:
    """Read the specification that `Mission.to_json` wrote."""
    import json  # noqa: PLC0415 - only here

    try:
        raw = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise UnreadableFileError(f"{what}: holds no readable mission: {error}") from None
    return build_mission(raw, what)


def shipped_missions() -> list[Path]:
    """Return the mission files that come with the package, from a wheel or a checkout."""
    packaged = Path(str(files("mpc_cover").joinpath("configs")))
    checkout = Path(__file__).resolve().parents[2] / "configs"
    folder = packaged if packaged.is_dir() else checkout
    return sorted(folder.rglob("*.yaml"))


def _find(path: Path) -> Path:
    """Return the mission's file; a folder of the same name does not hide a mission of the package."""
    with contextlib.suppress(OSError, ValueError):  # a name that no file can have
        if path.is_file():
            return path
        if path.parent == Path():
            for shipped in shipped_missions():
                if path.name in (shipped.stem, shipped.name):
                    return shipped
        if path.exists():
            return path
    names = ", ".join(shipped.stem for shipped in shipped_missions())
    raise UnreadableFileError(f"mission {path}: no such file, nor one of the missions that come along: {names}")


def _named(problems: list[Problem], raw: object) -> list[Problem]:
    """Return the problems of agents with their ids: a number that counts from 0 is easily misread."""
    fleet = raw.get("fleet") if isinstance(raw, dict) else None
    agents = fleet.get("agents") if isinstance(fleet, dict) else None
    named = []
    for problem in problems:
        match = re.match(r"fleet\.agents\.(\d+)(?:\.|$)", problem.path)
        index = int(match[1]) if match else -1
        agent = agents[index] if isinstance(agents, list) and 0 <= index < len(agents) else None
        name = agent.get("id") if isinstance(agent, dict) else None
        named.append(replace(problem, of=name) if isinstance(name, str) and name.isprintable() else problem)
    return named


def _cross_field_problems(raw: object, found: list[Problem]) -> list[Problem]:
    """Validate across the fields even though some are wrong: replace those by neutral values first."""
    repaired = _without(raw, [problem.path for problem in found])
    if not isinstance(repaired, dict):
        return []
    repaired = {"schema": 1, "name": "unnamed", **repaired}
    stand_in = {"shape": {"kind": "box", "min_m": [0, 0], "max_m": [1, 1]}, "cell_size_m": 1}
    for attempt, area_known in ((repaired, True), ({**repaired, "area": stand_in}, False)):
        with contextlib.suppress(ValidationError):
            problems = find_problems(MissionSpec.model_validate(attempt), area_known=area_known)
            break
    else:
        return []
    spoilt = {problem.path.rsplit(".", 1)[-1] for problem in found}
    if "sensing_radius_m" in spoilt:
        spoilt.add("magnitudes")  # measured by no agent, but only because of the radius
    return [problem for problem in problems if problem.path.rsplit(".", 1)[-1] not in spoilt]


def _without(raw: object, paths: list[str]) -> object:
    """Return a copy of `raw` without the optional values at these dotted paths."""
    if not paths:
        return raw
    if isinstance(raw, dict):
        here = {path.split(".", 1)[0] for path in paths if "." not in path}
        return {
            key: _without(value, [p.split(".", 1)[1] for p in paths if p.startswith(f"{key}.")])
            for key, value in raw.items()
            if str(key) not in here
        }
    if isinstance(raw, list):
        return [
            _without(value, [p.split(".", 1)[1] for p in paths if p.startswith(f"{i}.")]) for i, value in enumerate(raw)
        ]
    return raw
