"""Clarabel's cones, its deadline, and its layout of the rows."""

from __future__ import annotations

import math

import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import given, settings
from hypothesis import strategies as st
from qp_strategies import qp_of
from solver_doubles import FakeClock

from solvers.backends.clarabel_ import ClarabelBackend
from solvers.backends.options import Options
from solvers.backends.registry import BACKENDS, make_backend
from solvers.qp import QP, InvalidQPError, SecondOrderCones
from solvers.status import Status

DISC = SecondOrderCones(sp.csc_array(np.vstack((np.zeros((1, 2)), np.eye(2)))), np.array([1.0, 0.0, 0.0]), (3,))
TIGHT = Options(tolerance=1e-9)


def disc(q: list[float], A: object = (), lower: object = (), upper: object = ()) -> QP:
    return qp_of(np.zeros((2, 2)), q, A, lower, upper, cones=DISC)


def test_linear_objective_on_a_disc() -> None:
    backend = ClarabelBackend()
    backend.setup(disc([-3.0, -4.0]), TIGHT)
    found = backend.solve()
    assert found.ok
    assert found.x == pytest.approx([0.6, 0.8], abs=1e-6)
    assert found.cone_dual == pytest.approx([5.0, -3.0, -4.0], abs=1e-6)


def test_disc_and_rows_and_updates() -> None:
    backend = ClarabelBackend()
    backend.setup(disc([-1.0, -1.0], np.eye(2), [-1, -1], [0.5, 1]), TIGHT)
    found = backend.solve()
    assert found.x == pytest.approx([0.5, math.sqrt(0.75)], abs=1e-6)
    assert found.y[0] > 0.1
    backend.update(A=np.array([2.0, 1.0]))
    assert backend.solve().x == pytest.approx([0.25, math.sqrt(1 - 0.0625)], abs=1e-6)
    backend.update(l=np.array([0.2, -1.0]), u=np.array([0.2, 1.0]))  # an equality now
    assert backend.solve().x == pytest.approx([0.1, math.sqrt(0.99)], abs=1e-6)


def test_several_cones_of_different_sizes() -> None:
    # |x0| <= 2 as a cone of two rows, x1 <= 3 as a cone of one row
    G = sp.csc_array(np.array([[0.0, 0.0], [1.0, 0.0], [0.0, -1.0]]))
    cones = SecondOrderCones(G, np.array([2.0, 0.0, 3.0]), (2, 1))
    backend = ClarabelBackend()
    backend.setup(qp_of(np.zeros((2, 2)), [-1.0, -1.0], [], [], [], cones=cones), TIGHT)
    found = backend.solve()
    assert found.ok
    assert found.x == pytest.approx([2.0, 3.0], abs=1e-6)


@settings(max_examples=25)
@given(st.integers(0, 10_000))
def test_projection_on_discs(seed: int) -> None:
    rng = np.random.default_rng(seed)
    target, radius = rng.uniform(-3, 3, 2), rng.uniform(0.1, 2.0)
    cones = SecondOrderCones(DISC.G, np.array([radius, 0.0, 0.0]), (3,))
    backend = ClarabelBackend()
    backend.setup(qp_of(np.eye(2), -target, [], [], [], cones=cones), TIGHT)
    found = backend.solve()
    wanted = target * min(1.0, radius / float(np.linalg.norm(target)))
    assert found.ok
    assert found.x == pytest.approx(wanted, abs=1e-5)


def test_infeasible_cone() -> None:
    backend = ClarabelBackend()
    backend.setup(disc([0.0, 0.0], np.eye(2), [2, -1], [3, 1]))
    assert backend.solve().status is Status.PRIMAL_INFEASIBLE


@pytest.mark.parametrize("name", [name for name in BACKENDS if not BACKENDS[name].capabilities.second_order_cones])
def test_others_refuse_cones(name: str) -> None:
    with pytest.raises(InvalidQPError, match=f"{name} has no second-order cones"):
        make_backend(name).setup(disc([1.0, 0.0]))


def test_new_cones_need_a_set_up() -> None:
    backend = ClarabelBackend()
    backend.load(disc([-1.0, 0.0]))
    assert not backend.load(disc([0.0, -1.0]))
    twin = SecondOrderCones(DISC.G, 2.0 * DISC.h, DISC.sizes)
    assert backend.load(qp_of(np.zeros((2, 2)), [-1, 0], [], [], [], cones=twin))
    assert backend.solve().x == pytest.approx([2, 0], abs=1e-5)


def test_only_our_clock_counts() -> None:
    backend = ClarabelBackend(FakeClock())
    qp = disc([-1.0, -1.0], np.eye(2), [-1, -1], [0.5, 1])
    backend.setup(qp)
    for _ in range(50):  # what Clarabel's own time limit would add up
        backend.update(P=qp.P.data, q=qp.q, A=qp.A.data, l=qp.l, u=qp.u)
        assert backend.solve(time_limit_s=1e-12).ok


def test_the_deadline_is_looked_at_between_iterations() -> None:
    backend = ClarabelBackend(FakeClock(step_s=1.0))
    backend.setup(disc([-1.0, -1.0], np.eye(2), [-1, -1], [0.5, 1]))
    backend.solve()
    # one look before, one look for the deadline, then one an iteration
    found = backend.solve(time_limit_s=4.5)
    assert found.status is Status.TIME_LIMIT
    assert found.detail == "CallbackTerminated"
    assert 0 < found.iterations < 5
    assert backend.solve().ok


def test_finite_x_after_a_numerical_error_is_not_valid() -> None:
    backend = ClarabelBackend()
    backend.setup(disc([-3.0, -4.0]))
    backend.solve()
    backend._native.update(q=np.array([np.nan, 0.0]))  # past the guards
    found = backend.solve()
    assert found.detail == "NumericalError"
    assert found.status is Status.NUMERICAL_ERROR
    assert backend.solve().x == pytest.approx([0.6, 0.8], abs=1e-5)
