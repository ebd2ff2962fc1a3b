"""Figures 1.1 and 1.2: the sizing model against simulations."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

import numpy as np
from matplotlib.ticker import MaxNLocator

from mpc_cover.view.style import INK, QUIET, agent_style, new_figure

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.figure import Figure

    from mpc_cover.arrays import FloatArray


class Curve(Protocol):
    """The covered part over time for N agents; `studies.sizing_simulation` has one."""

    @property
    def agents(self) -> int:
        """N."""
        ...

    @property
    def time(self) -> FloatArray:
        """(T,) [s]."""
        ...

    @property
    def model(self) -> FloatArray:
        """(T,) by (1.2)."""
        ...

    @property
    def simulated(self) -> FloatArray:
        """(T,) mean over seeds."""
        ...

    @property
    def spread(self) -> FloatArray:
        """(2, T) smallest and largest over seeds."""
        ...

    @property
    def rate_hz(self) -> float:
        """Rate of measurement in the simulations."""
        ...


def figure_1_1(curves: Sequence[Curve], law: str = "potential law") -> Figure:
    """Draw the covered part over time: model dashed, simulations solid with the range of their seeds."""
    figure = new_figure(8.8, 5.2)
    axes = figure.add_subplot()
    for index, curve in enumerate(curves):
        colour, _ = agent_style(index)
        error = float(np.abs(curve.model - curve.simulated).mean())
        label = f"N = {curve.agents}: mean |error| {100.0 * error:.1f} %"
        axes.fill_between(curve.time, *(100.0 * curve.spread), color=colour, alpha=0.15, linewidth=0)
        axes.plot(curve.time, 100.0 * curve.simulated, color=colour, linewidth=2.2, label=label)
        axes.plot(curve.time, 100.0 * curve.model, color=colour, linewidth=1.8, linestyle=(0, (5, 2)))
    axes.plot([], [], color=INK, linewidth=2.2, label=f"simulated: {law}; band: range of seeds")
    axes.plot([], [], color=INK, linewidth=1.8, linestyle=(0, (5, 2)), label="model (1.2)")
    axes.legend(loc="lower right")
    axes.set_title("Covered part of the area over time")
    axes.set_xlabel("time [s]")
    axes.set_ylabel("covered [%]")
    axes.set_xlim(0.0, float(max(curve.time[-1] for curve in curves)))
    axes.set_ylim(0.0, 103.0)
    return figure


def figure_1_2(agents: FloatArray, rate_hz: FloatArray, cover: float, curves: Sequence[Curve] = ()) -> Figure:
    """Draw the rate of measurement (n,) [Hz] by the model (1.3) against (n,) numbers of agents, and simulated ones."""
    figure = new_figure(8.0, 5.0)
    axes = figure.add_subplot()
    finite = np.isfinite(rate_hz)
    axes.plot(agents[finite], rate_hz[finite], color=INK, linewidth=1.8, linestyle=(0, (5, 2)), label="model (1.3)")
    axes.plot(agents[finite], rate_hz[finite], ".", color=INK, markersize=5)
    for index, curve in enumerate(curves):
        colour, _ = agent_style(index)
        axes.plot(curve.agents, curve.rate_hz, "o", color=colour, markersize=9, markeredgecolor="white", zorder=4)
        axes.annotate(
            f"{curve.rate_hz:.2f} Hz",
            (curve.agents, curve.rate_hz),
            xytext=(-8, 5),
            textcoords="offset points",
            ha="right",
            color=colour,
            fontsize=9.5,
        )
    if curves:
        axes.plot([], [], "o", color=QUIET, markersize=9, label="simulated")
    axes.legend(loc="upper left")
    axes.set_title(f"Rate at which {100.0 * cover:g} % of the area is measured")
    axes.set_xlabel("agents N")
    axes.set_ylabel("rate f [Hz]")
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.set_xlim(0.0, float(agents.max()) + 0.5)
    axes.set_ylim(0.0, 1.12 * max(float(rate_hz[finite].max()), *(curve.rate_hz for curve in curves), 0.0))
    return figure
