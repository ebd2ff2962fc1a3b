"""The smooth NLP: J_beta goes down, and what leaves the box between samples is a violation."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st
from motions import random_window, replace, settings

from mpc_cover.planning.coverage_nlp import CoverageNLP
from mpc_cover.planning.scp import FEASIBILITY
from solvers import sqp
from solvers.backends.registry import make_backend


@hypothesis_settings(max_examples=15)
@given(seed=st.integers(0, 10**4), backend=st.sampled_from(["piqp", "osqp", "clarabel"]))
def test_j_beta_never_rises_from_one_accepted_iterate_to_the_next(seed, backend):
    ocp, x = random_window(seed)
    problem = CoverageNLP(ocp, settings())
    first = problem.measure(x)
    result = sqp.solve(problem, x, make_backend(backend), sqp.Options(max_iterations=5, feasibility=FEASIBILITY))
    values = [first.merit(50.0), *(it.objective for it in result.history)]
    assert all(later <= earlier + 1e-9 for earlier, later in pairwise(values))
    assert result.violation <= FEASIBILITY


def test_a_path_that_leaves_the_box_between_two_samples_only_is_a_violation():
    """At both samples 1 cm inside the wall, but the parabola's vertex lies beyond it."""
    ocp, _ = random_window(1, steps=2, agents=1)
    limit = ocp.fleet.motion_max[0]
    ends = replace(ocp.ends, start_position=np.array([[limit - 0.01, 4.0]]), start_velocity=np.array([[0.3, 0.0]]))
    ocp = replace(ocp, ends=ends)
    velocity = np.array([[[0.3, 0.0]], [[-0.3, 0.0]], [[0.0, 0.0]]])
    problem = CoverageNLP(ocp, settings())
    violation = problem.measure(ocp.decision(ends.start_position, velocity)).violation
    assert violation == pytest.approx(0.3**2 / (2 * 1.2) - 0.01)
