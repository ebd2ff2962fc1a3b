"""Out of local minima: shake the best motion, refine it again, keep what is better (basin hopping).

Which samples measure which cells is a combinatorial choice that no descent leaves by itself: from one guess
nearly every schedule of the continuation ends somewhere else. Monte Carlo over the minima themselves (Wales &
Doye, J. Phys. Chem. A 101, 1997) finds better ones at the price of a few descents.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.coverage.nearest import remaining_weight
from mpc_cover.planning.scp import MARGIN, evaluate, is_better, length_scale, optimise, optimise_without_margin

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from mpc_cover.arrays import FloatArray
    from mpc_cover.planning.budget import Budget
    from mpc_cover.planning.ocp import OCP
    from mpc_cover.planning.scp import SCPResult
    from solvers.backends.base import Backend

_AMPLITUDES = (0.15, 0.3, 0.6, 1.0, 2.0)
"""How far a shake moves a motion, in sensing radii: small ones repair, large ones rearrange."""
_MODES = 4
"""A shake is a sum of so many sines over the window: smooth enough to be nearly flyable."""
_MARGINS = (MARGIN, 0.5 * MARGIN)
_AFRESH = 3
"""Every so many hops one begins from a guess."""
_KICKS, _KICK, _KICKED = 4, 4.0, (10.0, 30.0, 100.0)
"""What is uncovered weighs so much more, so many times, and the stages that follow."""
_WORTH_SETTLING = 0.01
"""Less than this many sensing radii of cost may be no more than the sensing margins' doing."""
_WORTH_KICKING = 1.0
"""More than this many sensing radii of cost is no matter of a few cells."""


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
    """Return the best of `best` and what its shaken relatives are refined to; anytime.

    Every third relative is one of the `guesses` instead, in turn: the basin itself may be a bad one. `rounds` bounds
    the hops, None for as many as the budget allows; `seed` is that
    of the shakes; `on_progress` hears of each better motion.
    """
    rng = np.random.default_rng(seed)
    scale, stages, done = length_scale(ocp), best.stages, 0
    while not best.complete and not budget.exhausted and (rounds is None or done < rounds):
        done += 1
        base = best.x
        if guesses and done % _AFRESH == 0:
            base = guesses[(done // _AFRESH - 1) % len(guesses)]
        x = perturbed(ocp, base, float(rng.choice(_AMPLITUDES)) * scale, rng)
        margin = float(rng.choice(_MARGINS))
        found = optimise(ocp, x, backend, region=0.5, margin=margin, budget=budget, exact_cones=exact_cones)
        stages += found.stages
        if is_better(found, best):
            best = reweighted(ocp, replace(found, stages=()), backend, budget=budget, exact_cones=exact_cones)
            stages += best.stages
            if on_progress is not None:
                on_progress(best)
    return replace(best, stages=stages)


def reweighted(ocp: OCP, best: SCPResult, backend: Backend, *, budget: Budget, exact_cones: bool = False) -> SCPResult:
    """Return the best of a motion and what it becomes when the few cells that it leaves weigh more and more."""
    stages, weight, scale = best.stages, ocp.weight, length_scale(ocp)
    for _ in range(_KICKS):
        if best.complete or best.cost > _WORTH_KICKING * scale or not best.feasible:
            break
        if best.cost < _WORTH_SETTLING * scale:
            tight = optimise_without_margin(
                ocp, replace(best, stages=()), backend, budget=budget, exact_cones=exact_cones
            )
            stages += tight.stages
            best = tight
            if best.complete:
                break
        position, _velocity = ocp.motion(best.x)
        left = remaining_weight(position, ocp.cell, ocp.fleet.radius, ocp.weight) > 0.0
        weight = np.where(left, _KICK * weight, weight)
        pushed = optimise(
            replace(ocp, weight=weight),
            best.x,
            backend,
            sharpness=_KICKED,
            iterations=5,
            region=0.5,
            budget=budget,
            exact_cones=exact_cones,
        )
        stages += pushed.stages
        last = evaluate(ocp, pushed.stages[-1].x if pushed.stages else best.x)
        best = last if is_better(last, best) else best
    return replace(best, stages=stages)


def perturbed(ocp: OCP, x: FloatArray, amplitude: float, rng: np.random.Generator) -> FloatArray:
    """Return a decision vector with every path moved by smooth random amounts of about `amplitude` [m].

    The ends that are given stay as they are; limits and distances are left to whoever refines it.
    """
    position, velocity = ocp.motion(x)
    phase = np.linspace(0.0, np.pi, ocp.steps + 1)
    mode = np.arange(1, _MODES + 1)
    sines = np.sin(phase[:, None] * mode) / np.sqrt(mode)
    size = rng.normal(scale=amplitude, size=(_MODES, *position.shape[1:]))
    moved = np.einsum("nk,kmd->nmd", sines, size)
    faster = velocity + np.gradient(moved, ocp.period, axis=0)
    start = position[0] if ocp.first else position[0] + rng.normal(scale=0.5 * amplitude, size=position[0].shape)
    return ocp.exact_ends(ocp.decision(start, faster))
