"""Problems of Hock & Schittkowski, Test Examples for Nonlinear Programming Codes (1981), by number.

Constraints are written h(x) = 0 and g(x) <= 0. Every function is analytic, so that a complex step gives
its derivatives to the last digit (Squire & Trapp, 1998).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from smooth_nlp import Functions, SmoothNLP

if TYPE_CHECKING:
    from collections.abc import Callable

    Function = Callable[[Any], Any]


@dataclass(frozen=True)
class Problem:
    number: int
    start: tuple[float, ...]
    best: float
    objective: Function
    equalities: Function | None = None
    inequalities: Function | None = None
    lower: tuple[float, ...] | None = None
    upper: tuple[float, ...] | None = None
    solution: tuple[float, ...] | None = None  # where it is unique

    @property
    def x0(self) -> Any:
        return np.array(self.start)

    def nlp(self, *, exact: bool = False, weight: float = 10.0) -> SmoothNLP:
        n = len(self.start)
        h, g = self.equalities, self.inequalities
        functions = Functions(
            self.objective,
            gradient(self.objective),
            vector(h) if h else None,
            jacobian(h) if h else None,
            vector(g) if g else None,
            jacobian(g) if g else None,
            hessian=self.lagrangian_hessian if exact else None,
        )
        lower = None if self.lower is None else np.array(self.lower)
        upper = None if self.upper is None else np.array(self.upper)
        return SmoothNLP(functions, n, lower, upper, weight)

    def lagrangian_hessian(self, x: Any, eq: Any, ineq: Any) -> Any:
        def lagrangian(z: Any) -> Any:
            value = self.objective(z)
            if self.equalities:
                value = value + eq @ np.array(self.equalities(z))
            if self.inequalities:
                value = value + ineq @ np.array(self.inequalities(z))
            return value

        slope, step = gradient(lagrangian), 1e-5
        rows = [(slope(x + step * e) - slope(x - step * e)) / (2 * step) for e in np.eye(x.size)]
        return np.array(rows)


def vector(function: Function) -> Function:
    return lambda x: np.array(function(x))


def gradient(function: Function) -> Function:
    return lambda x: jacobian(lambda z: [function(z)])(x)[0]


def jacobian(function: Function) -> Function:
    def evaluate(x: Any) -> Any:
        columns = [np.imag(np.array(function(x + 1e-30j * e))) / 1e-30 for e in np.eye(x.size)]
        return np.array(columns).T

    return evaluate


def _43(x: Any) -> list[Any]:
    a, b, c, d = x
    return [
        a**2 + b**2 + c**2 + d**2 + a - b + c - d - 8,
        a**2 + 2 * b**2 + c**2 + 2 * d**2 - a - d - 10,
        2 * a**2 + b**2 + c**2 + 2 * a - b - d - 5,
    ]


INF = float("inf")
PROBLEMS = (
    Problem(
        1,
        (-2.0, 1.0),
        0.0,
        lambda x: 100 * (x[1] - x[0] ** 2) ** 2 + (1 - x[0]) ** 2,
        lower=(-INF, -1.5),
        solution=(1.0, 1.0),
    ),
    Problem(
        6,
        (-1.2, 1.0),
        0.0,
        lambda x: (1 - x[0]) ** 2,
        lambda x: [10 * (x[1] - x[0] ** 2)],
        solution=(1.0, 1.0),
    ),
    Problem(
        7,
        (2.0, 2.0),
        -(3.0**0.5),
        lambda x: np.log(1 + x[0] ** 2) - x[1],
        lambda x: [(1 + x[0] ** 2) ** 2 + x[1] ** 2 - 4],
        solution=(0.0, 3.0**0.5),
    ),
    Problem(
        10,
        (-10.0, 10.0),
        -1.0,
        lambda x: x[0] - x[1],
        inequalities=lambda x: [3 * x[0] ** 2 - 2 * x[0] * x[1] + x[1] ** 2 - 1],
        solution=(0.0, 1.0),
    ),
    Problem(
        12,
        (0.0, 0.0),
        -30.0,
        lambda x: 0.5 * x[0] ** 2 + x[1] ** 2 - x[0] * x[1] - 7 * x[0] - 7 * x[1],
        inequalities=lambda x: [4 * x[0] ** 2 + x[1] ** 2 - 25],
        solution=(2.0, 3.0),
    ),
    Problem(
        21,
        (-1.0, -1.0),
        -99.96,
        lambda x: 0.01 * x[0] ** 2 + x[1] ** 2 - 100,
        inequalities=lambda x: [10 - 10 * x[0] + x[1]],
        lower=(2.0, -50.0),
        upper=(50.0, 50.0),
        solution=(2.0, 0.0),
    ),
    Problem(
        26,
        (-2.6, 2.0, 2.0),
        0.0,
        lambda x: (x[0] - x[1]) ** 2 + (x[1] - x[2]) ** 4,
        lambda x: [(1 + x[1] ** 2) * x[0] + x[2] ** 4 - 3],
    ),
    Problem(
        28,
        (-4.0, 1.0, 1.0),
        0.0,
        lambda x: (x[0] + x[1]) ** 2 + (x[1] + x[2]) ** 2,
        lambda x: [x[0] + 2 * x[1] + 3 * x[2] - 1],
        solution=(0.5, -0.5, 0.5),
    ),
    Problem(
        35,
        (0.5, 0.5, 0.5),
        1 / 9,
        lambda x: (
            9
            - 8 * x[0]
            - 6 * x[1]
            - 4 * x[2]
            + 2 * x[0] ** 2
            + 2 * x[1] ** 2
            + x[2] ** 2
            + 2 * x[0] * x[1]
            + 2 * x[0] * x[2]
        ),
        inequalities=lambda x: [x[0] + x[1] + 2 * x[2] - 3],
        lower=(0.0, 0.0, 0.0),
        solution=(4 / 3, 7 / 9, 4 / 9),
    ),
    Problem(
        39,
        (2.0, 2.0, 2.0, 2.0),
        -1.0,
        lambda x: -x[0],
        lambda x: [x[1] - x[0] ** 3 - x[2] ** 2, x[0] ** 2 - x[1] - x[3] ** 2],
        solution=(1.0, 1.0, 0.0, 0.0),
    ),
    Problem(
        40,
        (0.8, 0.8, 0.8, 0.8),
        -0.25,
        lambda x: -x[0] * x[1] * x[2] * x[3],
        lambda x: [x[0] ** 3 + x[1] ** 2 - 1, x[0] ** 2 * x[3] - x[2], x[3] ** 2 - x[1]],
        solution=(2 ** (-1 / 3), 2 ** (-1 / 2), 2 ** (-11 / 12), 2 ** (-1 / 4)),
    ),
    Problem(
        43,
        (0.0, 0.0, 0.0, 0.0),
        -44.0,
        lambda x: x[0] ** 2 + x[1] ** 2 + 2 * x[2] ** 2 + x[3] ** 2 - 5 * x[0] - 5 * x[1] - 21 * x[2] + 7 * x[3],
        inequalities=_43,
        solution=(0.0, 1.0, 2.0, -1.0),
    ),
    Problem(
        48,
        (3.0, 5.0, -3.0, 2.0, -2.0),
        0.0,
        lambda x: (x[0] - 1) ** 2 + (x[1] - x[2]) ** 2 + (x[3] - x[4]) ** 2,
        lambda x: [x[0] + x[1] + x[2] + x[3] + x[4] - 5, x[2] - 2 * (x[3] + x[4]) + 3],
        solution=(1.0, 1.0, 1.0, 1.0, 1.0),
    ),
    Problem(
        71,
        (1.0, 5.0, 5.0, 1.0),
        17.0140173,
        lambda x: x[0] * x[3] * (x[0] + x[1] + x[2]) + x[2],
        lambda x: [x[0] ** 2 + x[1] ** 2 + x[2] ** 2 + x[3] ** 2 - 40],
        lambda x: [25 - x[0] * x[1] * x[2] * x[3]],
        lower=(1.0, 1.0, 1.0, 1.0),
        upper=(5.0, 5.0, 5.0, 5.0),
        solution=(1.0, 4.7429994, 3.8211503, 1.3794082),
    ),
    Problem(
        76,
        (0.5, 0.5, 0.5, 0.5),
        -103 / 22,
        lambda x: (
            x[0] ** 2
            + 0.5 * x[1] ** 2
            + x[2] ** 2
            + 0.5 * x[3] ** 2
            - x[0] * x[2]
            + x[2] * x[3]
            - x[0]
            - 3 * x[1]
            + x[2]
            - x[3]
        ),
        inequalities=lambda x: [
            x[0] + 2 * x[1] + x[2] + x[3] - 5,
            3 * x[0] + x[1] + 2 * x[2] - x[3] - 4,
            1.5 - x[1] - 4 * x[2],
        ],
        lower=(0.0, 0.0, 0.0, 0.0),
        solution=(3 / 11, 23 / 11, 0.0, 6 / 11),
    ),
)
BY_NUMBER = {problem.number: problem for problem in PROBLEMS}
