"""Back-ends by name, imported only when asked for."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from solver_doubles import FakeClock

from solvers.backends.capabilities import Capabilities
from solvers.backends.registry import BACKENDS, UnknownBackendError, backends_with_cones, make_backend


def test_names() -> None:
    assert list(BACKENDS) == ["native", "osqp", "clarabel", "piqp"]
    assert len(BACKENDS) == 4
    assert all(BACKENDS[name].name == name for name in BACKENDS)


def test_capabilities_are_known_without_an_instance() -> None:
    assert backends_with_cones() == ("clarabel",)
    assert all(isinstance(BACKENDS[name].capabilities, Capabilities) for name in BACKENDS)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"fine": 1e-2}, "accurate <= fine <= inexact"),
        ({"accurate": 0.0}, "accurate <= fine <= inexact"),
        ({"inexact": np.nan}, "accurate <= fine <= inexact"),
        ({"entry_iteration_s": 0.0}, "entry_iteration_s"),
    ],
)
def test_capabilities_that_mean_nothing(change: dict, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        replace(BACKENDS["piqp"].capabilities, **change)


def test_unknown_name_lists_the_known_ones() -> None:
    with pytest.raises(UnknownBackendError, match="no back-end 'gurobi'; there are native, osqp, clarabel, piqp"):
        make_backend("gurobi")
    assert "gurobi" not in BACKENDS
    with pytest.raises(KeyError):
        BACKENDS["gurobi"]


def test_each_call_makes_a_new_one_with_its_clock() -> None:
    clock = FakeClock()
    one, two = make_backend("piqp", clock), make_backend("piqp")
    assert one is not two
    assert one._clock is clock


def test_no_library_is_imported_before_it_is_asked_for() -> None:
    script = (
        "import sys, solvers.backends.registry as r, solvers.sqp\n"
        "list(r.BACKENDS), 'osqp' in r.BACKENDS\n"
        "assert not {'osqp', 'clarabel', 'piqp'} & set(sys.modules)\n"
        "r.make_backend('piqp')\n"
        "assert {'osqp', 'clarabel', 'piqp'} & set(sys.modules) == {'piqp'}\n"
        "assert not any(name.split('.')[0] == 'mpc_cover' for name in sys.modules)\n"
    )
    subprocess.run([sys.executable, "-c", script], check=True)
