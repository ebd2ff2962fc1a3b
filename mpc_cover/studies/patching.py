"""Looking into code from outside: a module's name stands for something else for a while."""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator


@contextmanager
def patched(owner: object, name: str, value: object) -> Iterator[None]:
    """Put `value` in the place of `owner.name`, and back again whatever happens.

    Raises
    ------
    AttributeError
        There is no such name: what was to be looked at has moved.
    """
    before = getattr(owner, name)
    setattr(owner, name, value)
    try:
        yield
    finally:
        setattr(owner, name, before)
