"""Finds the function that `--extra module:function` names; the current folder comes first."""

from __future__ import annotations

import sys
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mpc_cover.errors import UserError
from mpc_cover.planning.cvxpy_extra.extra import Extra, describe

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import ModuleType


def extra_of(source: Extra | Callable[..., Any] | str | None) -> Extra | None:
    """Return the extra that a function is, or that a name, module:function, stands for; None for none.

    Raises
    ------
    UserError
        As `load_extra`; or it is no function.
    """
    if source is None or isinstance(source, Extra):
        return source
    if isinstance(source, str):
        return load_extra(source)
    if not callable(source):
        raise UserError(f"extra {source!r}: must be a function, or its name, module:function")
    module, name = getattr(source, "__module__", "?"), getattr(source, "__name__", type(source).__name__)
    if module == "__main__" and (script := getattr(sys.modules[module], "__file__", None)):
        module = Path(script).stem
    return Extra(f"{module}:{name}", source)


def load_extra(name: str) -> Extra:
    """Return the function module:function; the module may lie in the current folder.

    Raises
    ------
    UserError
        There is no such module or function, the module cannot be imported, or what it names is no function.
    """
    module_name, colon, function_name = name.partition(":")
    if (
        not colon
        or module_name.endswith(".py")
        or not all(part.isidentifier() for part in (*module_name.split("."), function_name))
    ):
        right = f", as in {Path(module_name).stem}:{function_name or 'function'}" if ".py" in module_name else ""
        raise UserError(f"extra {name}: must be module:function{right}")
    module = _imported(name, module_name)
    if not hasattr(module, function_name):
        there = [each for each, value in vars(module).items() if callable(value) and not each.startswith("_")]
        known = f"; it has {', '.join(sorted(there)[:8])}" if there else ""
        raise UserError(f"extra {name}: module {module_name} has no {function_name}{known}")
    function = getattr(module, function_name)
    if not callable(function):
        raise UserError(f"extra {name}: {function_name} is {type(function).__name__}: must be a function")
    return Extra(name, function)


def _imported(name: str, module_name: str) -> ModuleType:
    here = str(Path.cwd())
    if here not in sys.path:
        sys.path.insert(0, here)  # and stays: the function may import what lies beside it
    try:
        return import_module(module_name)
    except ModuleNotFoundError as error:
        if error.name is not None and (module_name == error.name or module_name.startswith(f"{error.name}.")):
            raise UserError(f"extra {name}: there is no module {error.name}, neither in {here} nor installed") from None
        raise UserError(f"extra {name}: {module_name} cannot be imported: {describe(error)}") from None
    except (Exception, SystemExit) as error:  # noqa: BLE001 - the user's own code may raise anything
        raise UserError(f"extra {name}: {module_name} cannot be imported: {describe(error)}") from None
