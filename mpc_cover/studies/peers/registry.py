"""The peers by name; each is imported when it is run, as most need optional packages."""

from __future__ import annotations

from dataclasses import dataclass, field
from importlib import import_module
from typing import TYPE_CHECKING, Any

from mpc_cover.errors import UserError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mpc_cover.studies.watch import Peer

OURS = "ours-native"
"""The peer whose times all others are compared with."""


@dataclass(frozen=True)
class Entry:
    """One peer: the module and name of its function, its options, and a description of one line."""

    name: str
    module: str
    function: str
    what: str
    options: dict[str, Any] = field(default_factory=dict)

    def load(self) -> Peer:
        """Import the peer; ModuleNotFoundError names the package that is missing."""
        function = getattr(import_module(f"mpc_cover.studies.peers.{self.module}"), self.function)

        def peer(case: Any, x: Any, watch: Any) -> Any:
            return function(case, x, watch, **self.options)

        return peer


_ENTRIES = (
    Entry(OURS, "ours", "from_guess", "`mpc-cover plan` from the given guess alone", {"backend": "native"}),
    Entry("ours-piqp", "ours", "from_guess", "the same by SQP, PIQP", {"backend": "piqp"}),
    Entry("ours-clarabel", "ours", "from_guess", "the same, Clarabel", {"backend": "clarabel"}),
    Entry("ours-osqp", "ours", "from_guess", "the same, OSQP", {"backend": "osqp"}),
    Entry("ours-starts", "ours", "from_own_starts", "`mpc-cover plan`: several starts of its own"),
    Entry("ipopt-smooth", "ipopt", "smoothed", "CasADi, IPOPT, soft minimum, L-BFGS", {"exact_hessian": False}),
    Entry("ipopt-hessian", "ipopt", "smoothed", "CasADi, IPOPT, soft minimum, exact Hessian", {"exact_hessian": True}),
    Entry("ipopt-min", "ipopt", "hard", "CasADi, IPOPT, the minimum as it is, L-BFGS"),
    Entry("sqpmethod", "sqpmethod", "smoothed", "CasADi's sqpmethod, soft minimum, BFGS"),
    Entry("slsqp", "slsqp", "smoothed", "SciPy's SLSQP, condensed (3.19 to 3.22), soft minimum"),
    Entry("slsqp-min", "slsqp", "hard", "the same, the minimum as it is: the thesis's own way"),
    Entry("jax-lbfgs", "jax_", "penalised", "JAX, SciPy's L-BFGS-B, soft minimum, quadratic penalties"),
    Entry("cvxpy", "cvxpy_", "canonicalised", "our subproblem written in CVXPY, canonicalised each time"),
)

PEERS = {entry.name: entry for entry in _ENTRIES}

OPTIONAL = dict.fromkeys(("casadi", "jax"), "pip install 'mpc-cover[peers]'")
"""Packages that only peers need, and how they are had."""


def chosen(names: str | None) -> list[Entry]:
    """Return the peers of a comma-separated list, in its order, or all of them.

    Raises
    ------
    UserError
        For an unknown name, or an empty list.
    """
    if names is None:
        return list(PEERS.values())
    wanted: Sequence[str] = list(dict.fromkeys(name.strip() for name in names.split(",") if name.strip()))
    unknown = [name for name in wanted if name not in PEERS]
    if unknown or not wanted:
        raise UserError(f"--peers {', '.join(unknown) or names!r}: nobody: must be some of {', '.join(PEERS)}")
    return [PEERS[name] for name in wanted]
