"""A QP with more variables than a back-end bears is refused before native code sees it."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp

from solvers.backends.registry import BACKENDS, make_backend
from solvers.qp import QP
from solvers.status import Status

SMALL = QP(sp.csc_array(np.eye(3)), np.ones(3), sp.csc_array(np.eye(3)), -np.ones(3), np.ones(3))


@pytest.mark.parametrize("name", BACKENDS)
def test_too_many_variables_are_an_error_and_no_native_call(name, monkeypatch):
    backend = make_backend(name)
    monkeypatch.setattr(type(backend), "capabilities", replace(backend.capabilities, variables_max=2))
    monkeypatch.setattr(type(backend), "_setup", lambda *_: pytest.fail("native code was called"))
    backend.setup(SMALL)
    solution = backend.solve()
    assert solution.status is Status.NUMERICAL_ERROR
    assert "at most 2 variables, not 3" in solution.detail


@pytest.mark.parametrize("name", BACKENDS)
def test_as_many_as_it_bears_are_solved(name, monkeypatch):
    backend = make_backend(name)
    monkeypatch.setattr(type(backend), "capabilities", replace(backend.capabilities, variables_max=3))
    backend.setup(SMALL)
    np.testing.assert_allclose(backend.solve().x, -np.ones(3), atol=1e-3)
