"""The interior point of `solvers.native` on the whole problem; the QPs that it cannot take the place of go to PIQP."""

from __future__ import annotations

from dataclasses import replace

from solvers.backends.piqp_ import PIQPBackend


class NativeBackend(PIQPBackend):
    """PIQP, in whose place callers descend on the whole problem where the compiled library can."""

    name = "native"

    capabilities = replace(PIQPBackend.capabilities, whole_problem=True)
