"""Counted work: what a QP costs is known from its size and iterations."""

from __future__ import annotations

import pytest
from motions import random_window, settings

from mpc_cover.planning.coverage_nlp import CoverageNLP
from mpc_cover.planning.metered_backend import metered
from solvers.backends.capabilities import Capabilities
from solvers.backends.piqp_ import PIQPBackend
from solvers.backends.registry import make_backend


class Unheard(PIQPBackend):
    """A back-end that no planner has heard of, and its pace."""

    name = "unheard"
    capabilities = Capabilities(
        second_order_cones=False, inexact=3e-3, fine=2e-4, accurate=1e-8, entry_iteration_s=2.5e-7
    )


def test_work_is_counted_by_the_pace_that_the_back_end_declares():
    (ocp, x), charges = random_window(1), []
    model = CoverageNLP(ocp, settings()).convexify(x, 0.6)
    for backend in (Unheard(), make_backend("piqp")):
        counted = metered(backend, charges.append)
        counted.setup(model.qp)
        iterations = counted.solve().iterations
    slower = Unheard.capabilities.entry_iteration_s - make_backend("piqp").capabilities.entry_iteration_s
    assert charges[0] - charges[1] == pytest.approx(slower * iterations * model.qp.A.nnz)


def test_a_limit_by_the_clock_changes_neither_the_answer_nor_what_it_costs():
    (ocp, x), charges, answers = random_window(1), [], []
    model = CoverageNLP(ocp, settings()).convexify(x, 0.6)
    for limit_s in (None, 0.0):
        counted = metered(make_backend("piqp"), charges.append)
        counted.setup(model.qp)
        answers.append(counted.solve(limit_s).x.tobytes())
    assert answers[0] == answers[1]
    assert charges[0] == charges[1] > 0.0
