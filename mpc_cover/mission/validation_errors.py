"""Validation errors of pydantic in the terms of a mission file: paths as the user wrote them, and what is expected."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from mpc_cover.errors import Problem

if TYPE_CHECKING:
    from pydantic import ValidationError
    from pydantic_core import ErrorDetails

_WORDS = {
    "missing": "is missing",
    "extra_forbidden": "is not a known key",
    "model_type": "must be a mapping of keys to values",
    "dict_type": "must be a mapping of keys to values",
    "float_type": "must be a number",
    "float_parsing": "must be a number",
    "finite_number": "must be finite",
    "string_type": "must be a text",
    "tuple_type": "must be a list",
    "too_short": "must have {min_length} or more entries",
    "too_long": "must have {max_length} or fewer entries",
    "union_tag_invalid": "must be of the kind {expected_tags}",
    "string_pattern_mismatch": "must be letters, digits, '_', '.' and '-', at most 64, the first a letter or digit",
}

_SHAPES = "box, disc or polygon"
_KINDS = {"information": "coverage, looks, effective, kalman or ageing"}


def problems_of(error: ValidationError, raw: object) -> list[Problem]:
    """Return one problem for each path, and only the deepest: a union reports each of its members."""
    first: dict[str, Problem] = {}
    for item in error.errors(include_url=False):
        problem = _problem(item, raw)
        first.setdefault(problem.path, problem)
    return [problem for path, problem in first.items() if not any(other.startswith(f"{path}.") for other in first)]


def _problem(item: ErrorDetails, raw: object) -> Problem:
    value = None if item["type"] == "missing" else item["input"]
    if item["type"] == "union_tag_not_found":
        right = f"must say of which kind it is: {_KINDS.get(str(item['loc'][-1]), _SHAPES)}"
    elif item["type"] in _WORDS:
        right = _WORDS[item["type"]].format(**item.get("ctx", {}))
    else:
        right = item["msg"].replace("Input should be", "must be").replace("Keys should be", "keys must be")
    return Problem(_path(item, raw), value, right)


def _path(item: ErrorDetails, raw: object) -> str:
    """Return the dotted path, without the tags of unions, which the user never wrote."""
    parts: list[str] = []
    here: Any = raw
    for depth, part in enumerate(item["loc"], 1):
        try:
            here = here[part]
        except (KeyError, IndexError, TypeError):
            if item["type"] != "missing" or depth < len(item["loc"]):
                continue
        parts.append(str(part) if str(part).isprintable() else ascii(part)[1:-1])
    return ".".join(parts) or "the file"
