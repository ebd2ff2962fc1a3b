"""Build hook of hatchling: compiles the library where there is a C compiler; without one the SQP with PIQP plans."""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

_HERE = Path("solvers/native")
_FLAGS = ("-O3", "-std=c99", "-D_POSIX_C_SOURCE=199309L", "-fno-math-errno", "-ffp-contract=off", "-shared", "-fPIC")
"""No contraction of products and sums: results do not depend on the instructions that a machine has."""


class NativeBuildHook(BuildHookInterface):  # type: ignore[misc] # it is not installed with the package
    """Compiles `src/*.c` into `_kernels.so`, which the wheel carries."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Compile, and mark the wheel as one for this platform; a failure is a warning."""
        del version
        target = Path(self.root) / _HERE / "_kernels.so"
        if self.target_name != "wheel" or not _compiled(Path(self.root) / _HERE / "src", target):
            return
        build_data["artifacts"].append(str(_HERE / target.name))
        platform = sysconfig.get_platform().replace("-", "_").replace(".", "_")
        build_data["pure_python"], build_data["tag"] = False, f"py3-none-{platform}"


def _compiled(sources: Path, target: Path) -> bool:
    """Return whether the library could be compiled."""
    named = os.environ.get("CC") or sysconfig.get_config_var("CC") or "cc"
    compilers = [command for command in (named, "cc", "gcc", "clang") if shutil.which(shlex.split(command)[0])]
    if not compilers:
        print("mpc-cover: no C compiler: plans are made by the slower SQP with PIQP", file=sys.stderr)  # noqa: T201
        return False
    files = sorted(str(path) for path in sources.glob("*.c"))
    command = [*shlex.split(compilers[0]), *_FLAGS, "-o", str(target), *files, "-lm"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)  # noqa: S603 - the user's compiler
    if done.returncode != 0:
        print(f"mpc-cover: {shlex.join(command)} failed:\n{done.stderr}", file=sys.stderr)  # noqa: T201
    return done.returncode == 0
