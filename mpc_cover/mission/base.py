"""Types of the numbers and names in missions, and the base class of their models."""

from __future__ import annotations

from typing import Annotated

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field
from pydantic_core import PydanticCustomError

LARGEST = 1e8
"""No number of a mission is larger, nor smaller than 1 / 1e8 unless it may be 0: products stay finite."""


def no_flag(value: object) -> object:
    """Refuse `yes` and `true`, which would pass for 1."""
    if isinstance(value, bool):
        raise PydanticCustomError("number_type", "must be a number, not true or false")
    return value


def _not_tiny(value: float) -> float:
    if value < 1.0 / LARGEST:
        raise PydanticCustomError("too_small", "must be at least {least}", {"least": 1.0 / LARGEST})
    return value


Finite = Annotated[float, Field(ge=-LARGEST, le=LARGEST, allow_inf_nan=False), BeforeValidator(no_flag)]
Positive = Annotated[
    float, Field(gt=0, le=LARGEST, allow_inf_nan=False), AfterValidator(_not_tiny), BeforeValidator(no_flag)
]
NonNegative = Annotated[float, Field(ge=0, le=LARGEST, allow_inf_nan=False), BeforeValidator(no_flag)]
Point = Annotated[tuple[Finite, ...], Field(min_length=2, max_length=3)]
Name = Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]{0,63}$")]


class Model(BaseModel):
    """Frozen, and a misspelt key is an error."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=False)
