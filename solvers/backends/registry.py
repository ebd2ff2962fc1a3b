"""The back-ends by name; each is imported on first use, so that processes without a solver start fast."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from importlib import import_module
from types import MappingProxyType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from solvers.backends.base import Backend

_PLACES = MappingProxyType(
    {
        "native": ("solvers.backends.native_", "NativeBackend"),
        "osqp": ("solvers.backends.osqp_", "OSQPBackend"),
        "clarabel": ("solvers.backends.clarabel_", "ClarabelBackend"),
        "piqp": ("solvers.backends.piqp_", "PIQPBackend"),
    }
)


class UnknownBackendError(ValueError):
    """An unknown back-end name; the message lists the known ones."""


class _Backends(Mapping[str, "type[Backend]"]):
    """The classes by name, imported on access; iterating over the names imports nothing."""

    def __getitem__(self, name: str) -> type[Backend]:
        module, attribute = _PLACES[name]
        found: type[Backend] = getattr(import_module(module), attribute)
        return found

    def __iter__(self) -> Iterator[str]:
        return iter(_PLACES)

    def __contains__(self, name: object) -> bool:
        return name in _PLACES

    def __len__(self) -> int:
        return len(_PLACES)


BACKENDS: Mapping[str, type[Backend]] = _Backends()


def backends_with_cones() -> tuple[str, ...]:
    """Return the names of the back-ends that take second-order cones; imports all of them."""
    return tuple(name for name, backend in BACKENDS.items() if backend.capabilities.second_order_cones)


def make_backend(name: str, clock: Callable[[], float] = time.perf_counter) -> Backend:
    """Return a new back-end.

    Raises
    ------
    UnknownBackendError: for a name that is not in `BACKENDS`.
    """
    if name not in BACKENDS:
        raise UnknownBackendError(f"no back-end {name!r}; there are {', '.join(BACKENDS)}")
    return BACKENDS[name](clock)
