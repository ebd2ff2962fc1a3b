"""Basin hopping: perturb the best motion, optimise it again, and keep the better one.

Which samples measure which cells is a combinatorial choice that no descent changes by itself: from one guess nearly
every continuation schedule ends in another local minimum. Monte Carlo over the minima themselves (Wales & Doye,
J. Phys. Chem. A 101, 1997) finds better ones at the price of a few descents.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.coverage.nearest import remaining_weight
from mpc_cover.planning.scp import (
    MARGIN,
    REFINEMENT_REGION,
    SHARPNESS,
    descends_natively,
    evaluate,
    is_better,
    length_scale,
    optimise,
    optimise_without_margin,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from mpc_cover.arrays import BoolArray, FloatArray
    from mpc_cover.planning.budget import Budget
    from mpc_cover.planning.ocp import OCP
    from mpc_cover.planning.scp import SCPResult
    from solvers.backends.base import Backend

_FEW_AMPLITUDES = (0.15, 0.3, 0.6, 1.0, 2.0)
"""Amplitudes of perturbations, in sensing radii, where there is time for a few hops only; plain choices."""
_AMPLITUDES = (0.02, 0.05, 0.1, 0.2, 0.35, 0.6, 1.0)
"""Amplitudes of perturbations, in sensing radii: small ones repair, large ones rearrange. Plain choices."""
_MODES = (2, 9)
"""Least number of sine modes of a perturbation over the horizon, and one more than the largest: smooth enough to be
nearly feasible. Plain choices."""
_ALONE_SHARE = 0.5
"""Part of the perturbations that move a single agent; a plain choice."""
_POOL, _EQUAL = 12, 0.02
"""Minima that are kept, and the difference in merit and displacement, in sensing radii, from which on two minima count
as two; plain choices."""
_KICKED_SHARE, _KICKS = 0.6, (2.0, 4.0, 8.0)
"""Part of the hops that increase the weights of what is left, and the factors; plain choices."""
_FIRST_STAGES = (0.4, 0.4, 0.2)
"""Parts of the hops that begin at the first, second and third stage of the continuation: the softer the first, the more
of the motion is rearranged. Plain choices."""
_NATIVE_HOPS = 10
"""Hops by descents of the library that take the place of one by QPs; it takes longer than they do, as measured."""
_START_SHARE = 0.5
"""Amplitude of the perturbation of a free start, relative to that of the motion; a plain choice."""
_MARGINS = (MARGIN, 0.5 * MARGIN)
"""Sensing margins times beta of hops, drawn at random; plain choices."""
_GUESS_EVERY = 3
"""Every so many hops one starts from an initial guess; a plain choice."""
WEIGHT_FACTOR = 4.0
"""Factor by which the weights of uncovered cells increase from one round of reweighting to the next; a plain choice."""
_REWEIGHTS, _REWEIGHT_ITERATIONS, _REWEIGHT_SHARPNESS = 4, 5, (10.0, 30.0, 100.0)
"""Rounds of reweighting, and QPs per stage and stages of each; plain choices."""
_FINAL_STAGE_COST = 0.01
"""Cost in sensing radii below which the sensing margin alone may cause it: the stage without margin follows. Plain
choice."""
_REWEIGHT_COST = 1.0
"""Cost in sensing radii above which more than a few cells are uncovered, and reweighting is skipped; a plain choice."""


def basin_hopping(
    ocp: OCP,
    best: SCPResult,
    backend: Backend,
    *,
    rounds: int | None,
    guesses: Sequence[FloatArray] = (),
    seed: int = 0,
    budget: Budget,
    exact_cones: bool = False,
    on_progress: Callable[[SCPResult], None] | None = None,
) -> SCPResult:
    """Return the best of `best` and the minima found from its perturbations; anytime.

    Every third hop perturbs one of the decision vectors `guesses`, in turn, as the basin itself may be a poor one.
    `rounds` bounds the hops (ten times as many of the library's), None for as many as the budget allows; `seed` is that
    of the perturbations; `on_progress` is called with each better result.
    """
    rng = np.random.default_rng(seed)
    if rounds is not None and descends_natively(ocp, backend, exact_cones=exact_cones):
        rounds *= _NATIVE_HOPS
    pool, stages, done = Pool(ocp), best.stages, 0
    pool.add(best)
    while not best.complete and not budget.exhausted and (rounds is None or done < rounds):
        done += 1
        base = pool.drawn(rng)
        if guesses and done % _GUESS_EVERY == 0:
            base = evaluate(ocp, guesses[(done // _GUESS_EVERY - 1) % len(guesses)])
        found = hop(ocp, base, backend, rng, budget=budget, exact_cones=exact_cones)
        stages += found.stages
        pool.add(found)
        if is_better(found, best):
            best = reweighted(ocp, replace(found, stages=()), backend, budget=budget, exact_cones=exact_cones)
            stages += best.stages
            pool.add(best)
            if on_progress is not None:
                on_progress(best)
    return replace(best, stages=stages)


class Pool:
    """The best minima found that differ from each other, the best first."""

    def __init__(self, ocp: OCP) -> None:
        self._ocp = ocp
        self._found: list[SCPResult] = []

    @property
    def empty(self) -> bool:
        """Whether nothing was added yet."""
        return not self._found

    @property
    def best(self) -> SCPResult:
        """The best minimum."""
        return self._found[0]

    def add(self, found: SCPResult) -> None:
        """Keep a minimum that is feasible or the first, and neither equal to another one nor worse than a full pool."""
        if (self._found and not found.feasible) or any(self._equal(found, one) for one in self._found):
            return
        self._found = sorted([*self._found, found], key=lambda one: (not one.feasible, one.merit))[:_POOL]

    def drawn(self, rng: np.random.Generator) -> SCPResult:
        """Return one at random, rather a good one."""
        return self._found[int(len(self._found) * rng.random() ** 2)]

    def _equal(self, one: SCPResult, other: SCPResult) -> bool:
        scale = length_scale(self._ocp)
        if abs(one.merit - other.merit) > _EQUAL * scale:
            return False
        apart = np.abs(self._ocp.motion(one.x)[0] - self._ocp.motion(other.x)[0])
        return float(apart.max()) <= _EQUAL * scale


def hop(
    ocp: OCP,
    base: SCPResult,
    backend: Backend,
    rng: np.random.Generator,
    *,
    budget: Budget,
    exact_cones: bool = False,
) -> SCPResult:
    """Return the minimum found from a perturbation of a motion, with greater weights of some of what it leaves."""
    scale, weight = length_scale(ocp), ocp.weight
    natively = descends_natively(ocp, backend, exact_cones=exact_cones)
    x = perturbed(ocp, base.x, float(rng.choice(_AMPLITUDES if natively else _FEW_AMPLITUDES)) * scale, rng)
    if rng.random() < _KICKED_SHARE:
        left = left_over(ocp, base.x)
        weight = np.where(left, float(rng.choice(_KICKS)) * weight, weight)
    sharpness = SHARPNESS[int(rng.choice(len(_FIRST_STAGES), p=_FIRST_STAGES)) if natively else 0 :]
    margin = float(rng.choice(_MARGINS))
    heavier = replace(ocp, weight=weight)
    found = optimise(
        heavier,
        x,
        backend,
        sharpness=sharpness,
        region=REFINEMENT_REGION,
        margin=margin,
        budget=budget,
        exact_cones=exact_cones,
    )
    return found if weight is ocp.weight else replace(evaluate(ocp, found.x), stages=found.stages)


def left_over(ocp: OCP, x: FloatArray) -> BoolArray:
    """Return which demand (J, K) of an OCP a motion leaves."""
    position, velocity = ocp.motion(x)
    return remaining_weight(position, ocp.cell, ocp.fleet.radius, ocp.weight, ocp.between(velocity)) > 0.0


def reweighted(ocp: OCP, best: SCPResult, backend: Backend, *, budget: Budget, exact_cones: bool = False) -> SCPResult:
    """Return the best of a motion and its refinements with increasing weights of the few cells that it leaves."""
    stages, weight, scale = best.stages, ocp.weight, length_scale(ocp)
    for _ in range(_REWEIGHTS):
        if best.complete or best.cost > _REWEIGHT_COST * scale or not best.feasible:
            break
        if best.cost < _FINAL_STAGE_COST * scale:
            final = optimise_without_margin(
                ocp, replace(best, stages=()), backend, budget=budget, exact_cones=exact_cones
            )
            stages += final.stages
            best = final
            if best.complete:
                break
        left = left_over(ocp, best.x)
        weight = np.where(left, WEIGHT_FACTOR * weight, weight)
        heavier = optimise(
            replace(ocp, weight=weight),
            best.x,
            backend,
            sharpness=_REWEIGHT_SHARPNESS,
            iterations=_REWEIGHT_ITERATIONS,
            region=REFINEMENT_REGION,
            budget=budget,
            exact_cones=exact_cones,
        )
        stages += heavier.stages
        last = evaluate(ocp, heavier.stages[-1].x if heavier.stages else best.x)
        best = last if is_better(last, best) else best
    return replace(best, stages=stages)


def perturbed(ocp: OCP, x: FloatArray, amplitude: float, rng: np.random.Generator) -> FloatArray:
    """Return a decision vector with every path displaced by smooth random amounts of about `amplitude` [m].

    Boundary conditions still hold; limits and distances may be violated.
    """
    position, velocity = ocp.motion(x)
    phase = np.linspace(0.0, np.pi, ocp.steps + 1)
    mode = np.arange(1, int(rng.integers(*_MODES)) + 1)
    sines = np.sin(phase[:, None] * mode) / np.sqrt(mode)
    size = rng.normal(scale=amplitude, size=(mode.size, *position.shape[1:]))
    if rng.random() < _ALONE_SHARE:
        size[:, np.arange(position.shape[1]) != rng.integers(position.shape[1])] = 0.0
    moved = np.einsum("nk,kmd->nmd", sines, size)
    faster = velocity + np.gradient(moved, ocp.period, axis=0)
    start = (
        position[0] if ocp.first else position[0] + rng.normal(scale=_START_SHARE * amplitude, size=position[0].shape)
    )
    return ocp.exact_ends(ocp.decision(start, faster))
