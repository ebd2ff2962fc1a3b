"""Reading missions: YAML in, a validated mission with its arrays out."""

from __future__ import annotations

from dataclasses import dataclass
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

if TYPE_CHECKING:
    from collections.abc import Hashable

    from pydantic_core import ErrorDetails


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
        problems = _problems_of(error, raw)
        problems += _cross_field_problems(raw, problems)
        raise InvalidInputError(what, problems) from None
    if problems := find_problems(spec):
        raise InvalidInputError(what, problems)
    lower, upper = bounding_box(spec.area.shape)
    motion_min = np.array(spec.area.motion_min_m) if spec.area.motion_min_m else lower
    motion_max = np.array(spec.area.motion_max_m) if spec.area.motion_max_m else upper
    return Mission(spec, build_field(spec.area), build_fleet(spec, motion_min, motion_max))


def load_mission(path: str | Path) -> Mission:
    """Read a mission file; a bare name such as `box-3` finds the missions that come with us.

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
    except (OSError, UnicodeDecodeError) as error:
        raise UnreadableFileError(f"mission {path}: cannot be read: {error}") from None
    except (yaml.YAMLError, RecursionError, ValueError, TypeError) as error:
        detail = " ".join(str(error).split())
        raise UnreadableFileError(f"mission {path}: is not valid YAML: {detail}") from None
    return build_mission(raw, f"mission {path}")


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
    if path.exists():
        return path
    if path.parent == Path():
        for shipped in shipped_missions():
            if path.name in (shipped.stem, shipped.name):
                return shipped
    names = ", ".join(shipped.stem for shipped in shipped_missions())
    raise UnreadableFileError(f"mission {path}: no such file, nor one of the missions that come along: {names}")


def _problems_of(error: ValidationError, raw: object) -> list[Problem]:
    """One problem a path: a union reports each of its members."""
    first: dict[str, Problem] = {}
    for item in error.errors(include_url=False):
        problem = _from_pydantic(item, raw)
        first.setdefault(problem.path, problem)
    return list(first.values())


def _from_pydantic(item: ErrorDetails, raw: object) -> Problem:
    parts: list[str] = []
    here: Any = raw
    for part in item["loc"]:
        try:
            here = here[part]
        except (KeyError, IndexError, TypeError):
            if item["type"] != "missing" or part != item["loc"][-1]:
                continue  # the tag of a union: the user never wrote it
        parts.append(str(part))
    path = ".".join(parts) or "the file"
    match item["type"]:
        case "extra_forbidden":
            return Problem(path, item["input"], "is not a known key")
        case "missing":
            return Problem(path, None, "is missing")
    message = item["msg"]
    return Problem(path, item["input"], message[:1].lower() + message[1:])


def _cross_field_problems(raw: object, found: list[Problem]) -> list[Problem]:
    """Look across the fields even though some are wrong: mend those with neutral values first."""
    mended = _without(raw, [problem.path for problem in found])
    try:
        spec = MissionSpec.model_validate(mended)
    except ValidationError:
        return []
    spoilt = {problem.path.rsplit(".", 1)[-1] for problem in found}
    if "sensing_radius_m" in spoilt:
        spoilt.add("magnitudes")  # measured by no agent, but only because of the radius
    return [problem for problem in find_problems(spec) if problem.path.rsplit(".", 1)[-1] not in spoilt]


def _without(raw: object, paths: list[str]) -> object:
    """Return a copy of `raw` without the optional values at these dotted paths."""
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
