"""Every back-end by name, and clocks that only move when they are told to."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from solver_accuracy import CLOSE, TIGHT
from solver_doubles import FakeClock

from solvers.backends.registry import BACKENDS, make_backend

if TYPE_CHECKING:
    from solvers.backends.base import Backend
    from solvers.backends.options import Options


@pytest.fixture(params=list(BACKENDS))
def backend_name(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture
def backend(backend_name: str) -> Backend:
    return make_backend(backend_name)


@pytest.fixture
def tight(backend_name: str) -> Options:
    return TIGHT[backend_name]


@pytest.fixture
def close(backend_name: str) -> float:
    return CLOSE[backend_name]


@pytest.fixture
def clock() -> FakeClock:
    return FakeClock()
