"""A user's function that returns terms and constraints in CVXPY, and what is wrong with what it returns."""

from __future__ import annotations

import inspect
import sysconfig
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import cvxpy as cp
import numpy as np

from mpc_cover.errors import UserError

if TYPE_CHECKING:
    from mpc_cover.mission.load import Mission
    from mpc_cover.planning.cvxpy_extra.motion_variables import MotionVariables

_LONGEST = 100
"""Characters of an expression in a message; a plain choice."""
_LIBRARIES = (
    *(sysconfig.get_paths()[name] for name in ("stdlib", "purelib", "platlib")),
    *(str(Path(module.__file__).parent) for module in (cp, np) if module.__file__),
)
_WANTED = "must return (terms, constraints), two lists or mappings"


@dataclass(frozen=True, eq=False)
class Group:
    """Constraints that are judged together.

    Attributes
    ----------
    name : the key in a mapping, the label, or the place in the list.
    constraints : CVXPY constraints.
    """

    name: str
    constraints: tuple[Any, ...]


@dataclass(frozen=True, eq=False)
class Parts:
    """What a user's function returned, validated.

    Attributes
    ----------
    terms : convex scalar expressions that are added to J (4.34) [m].
    groups : the constraints.
    """

    terms: tuple[Any, ...]
    groups: tuple[Group, ...]

    @property
    def constraints(self) -> list[Any]:
        """All constraints."""
        return [constraint for group in self.groups for constraint in group.constraints]

    @property
    def total(self) -> Any:
        """The sum of the terms, a scalar."""
        return cp.sum(cp.hstack([cp.sum(term) for term in self.terms])) if self.terms else cp.Constant(0.0)


@dataclass(frozen=True, eq=False)
class Extra:
    """A user's function of (motion, mission), with its name, module:function.

    It is called for every subproblem, with the iterate, and for every motion that is judged.
    """

    name: str
    function: Callable[[MotionVariables, Mission], Any]

    def parts(self, motion: MotionVariables, mission: Mission) -> Parts:
        """Return its terms and constraints for a motion.

        Raises
        ------
        UserError
            The function raises, or returns what is none: names which, and what would be right.
        """
        try:
            inspect.signature(self.function).bind(motion, mission)
        except TypeError:
            raise UserError(f"extra {self.name}: must take two arguments, (motion, mission)") from None
        except ValueError:  # some callables tell no signature
            pass
        try:
            returned = self.function(motion, mission)
        except (Exception, SystemExit) as error:  # noqa: BLE001 - the user's own code may raise anything
            raise UserError(f"extra {self.name}: {describe(error)}") from None
        if not isinstance(returned, tuple | list) or len(returned) != 2:  # noqa: PLR2004 - terms and constraints
            raise UserError(f"extra {self.name}: {_WANTED}, not {_kind(returned)}")
        terms, constraints = returned
        return Parts(tuple(self._terms(terms)), tuple(self._groups(constraints)))

    def _terms(self, terms: Any) -> Iterator[Any]:
        if isinstance(terms, cp.Expression):
            terms = [terms]
        for name, term in self._named("terms", terms):
            yield self._term(name, term)

    def _term(self, name: str, term: Any) -> Any:
        number = isinstance(term, int | float | np.number) and not isinstance(term, bool)
        if not number and not isinstance(term, cp.Expression):
            self._refuse(name, term, f"is {_kind(term)}: must be a convex CVXPY expression or a number")
        expression = cp.Constant(term) if number else term
        if not expression.is_scalar():
            self._refuse(name, term, f"has shape {expression.shape}: must be a scalar, for example its cp.sum")
        self._check_data(name, expression)
        if not expression.is_convex():
            said = "is concave, not convex" if expression.is_concave() else "is not convex by CVXPY's DCP rules"
            self._refuse(name, term, f"{said}: a term is minimised and must be convex")
        return expression

    def _groups(self, constraints: Any) -> Iterator[Group]:
        if isinstance(constraints, cp.Constraint):
            constraints = [constraints]
        for name, given in self._named("constraints", constraints):
            several = isinstance(given, tuple | list)
            members = [(f"{name}[{index}]", one) for index, one in enumerate(given)] if several else [(name, given)]
            for place, constraint in members:
                self._check_constraint(place, constraint)
            label = getattr(given, "label", None)  # CVXPY has labels since 1.8
            yield Group(str(label or name), tuple(one for _, one in members))

    def _check_constraint(self, name: str, constraint: Any) -> None:
        if isinstance(constraint, bool | np.bool_):
            self._refuse(name, constraint, "compares numbers: must be a CVXPY constraint on the motion")
        if not isinstance(constraint, cp.Constraint):
            self._refuse(name, constraint, f"is {_kind(constraint)}: must be a CVXPY constraint")
        self._check_data(name, constraint)
        if not constraint.is_dcp():
            right = "linearise it around motion.iterate"
            self._refuse(name, constraint, f"is not convex by CVXPY's DCP rules: {right}")

    def _check_data(self, name: str, item: Any) -> None:
        """Refuse numbers that are not finite, parameters without values, and whole or complex variables."""
        for constant in item.constants():
            if not np.isfinite(_dense(constant.value)).all():
                self._refuse(name, item, "holds a number that is not finite")
        for parameter in item.parameters():
            if parameter.value is None:
                self._refuse(name, item, f"has a parameter without a value, {parameter.name()}")
        for variable in item.variables():
            if variable.attributes["boolean"] or variable.attributes["integer"] or variable.is_complex():
                self._refuse(name, item, f"has a variable that is not real and continuous, {variable.name()}")

    def _named(self, what: str, given: Any) -> list[tuple[str, Any]]:
        """Return members with their names: keys of a mapping, or places in a list."""
        if given is None:
            return []
        if isinstance(given, Mapping):
            return [(str(key), member) for key, member in given.items()]
        if isinstance(given, Sequence) and not isinstance(given, str):
            return [(f"{what}[{index}]", member) for index, member in enumerate(given)]
        raise UserError(f"extra {self.name}: {_WANTED}: its {what} are {_kind(given)}")

    def _refuse(self, name: str, item: Any, why: str) -> None:
        raise UserError(f"extra {self.name}: {name}: {shown(item)}: {why}")


def describe(error: BaseException) -> str:
    """Return an exception of the user's code in one line: its kind, what it says, and the line of that code."""
    said = f"{type(error).__name__}: {' '.join(str(error).split())}".removesuffix(": ")
    if isinstance(error, SyntaxError):
        return f"{type(error).__name__}: {error.msg} ({_file(error.filename)}, line {error.lineno})"
    frames = traceback.extract_tb(error.__traceback__)[1:]  # the first is our own call
    own = [frame for frame in frames if not frame.filename.startswith((*_LIBRARIES, "<frozen"))] or frames
    place = f" ({_file(own[-1].filename)}, line {own[-1].lineno})" if own else ""
    return f"{said}{place}"


def shown(item: Any) -> str:
    """Return an expression in one short line."""
    text = " ".join(str(item).split())
    return text if len(text) <= _LONGEST else f"{text[: _LONGEST - 3]}..."


def _file(name: str | None) -> str:
    return Path(name).name if name else "?"


def _kind(value: Any) -> str:
    """Return what a value is, in words: of a tuple also how many there are."""
    count = f" of {len(value)}" if isinstance(value, tuple | list) else ""
    return f"{'None' if value is None else type(value).__name__}{count}"


def _dense(value: Any) -> Any:
    return value.data if hasattr(value, "tocsc") else np.asarray(value)
