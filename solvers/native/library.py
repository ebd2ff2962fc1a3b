"""The compiled library: its structures, and how it is found; its sources are in `src/`."""

from __future__ import annotations

import ctypes
from ctypes import POINTER, c_double, c_int32, c_void_p
from enum import IntEnum
from functools import lru_cache
from importlib.machinery import ExtensionFileLoader
from importlib.util import module_from_spec, spec_from_loader
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
import scipy

if TYPE_CHECKING:
    from types import ModuleType

    from numpy.typing import NDArray

LIBRARY = Path(__file__).with_name("_kernels.so")
"""Where the build puts the library."""


class Outcome(IntEnum):
    """Why a descent ended."""

    COMPLETE = 0
    CONVERGED = 1
    MAX_ITERATIONS = 2
    DEADLINE = 3
    NUMERICAL = 4
    OUT_OF_MEMORY = 5


class _Doubles(c_void_p):
    """Where an array of doubles is."""


class _Integers(c_void_p):
    """Where an array of 32-bit integers is."""


class _Flags(c_void_p):
    """Where an array of bytes is."""


_DTYPES: dict[Any, Any] = {_Doubles: np.float64, _Integers: np.int32, _Flags: np.uint8}


class Structure(ctypes.Structure):
    """A C structure whose pointers keep the arrays that they point into alive."""

    _arrays_: ClassVar[dict[str, Any]] = {}

    def __init_subclass__(cls) -> None:
        cls._arrays_ = {field[0]: _DTYPES[field[1]] for field in cls._fields_ if field[1] in _DTYPES}

    def __init__(self, **values: Any) -> None:
        super().__init__()
        self._kept: list[NDArray[Any]] = []
        for name, value in values.items():
            if (dtype := self._arrays_.get(name)) is None:
                setattr(self, name, value)
                continue
            array = np.ascontiguousarray(value, dtype=dtype)
            self._kept.append(array)
            setattr(self, name, array.__array_interface__["data"][0])


def _fields(kind: Any, names: str) -> list[tuple[str, Any]]:
    return [(name, kind) for name in names.split()]


class Problem(Structure):
    """The coverage problem; see `src/problem.h`."""

    _fields_ = [
        *_fields(c_int32, "steps agents dimension pairs first closed end_fixed long_steps linked instants"),
        *_fields(c_int32, "dense_max demands parts continuous"),
        *_fields(c_double, "range"),
        *_fields(_Doubles, "speed_max input_max speed_limit input_limit braking_input"),
        *_fields(_Flags, "active"),
        *_fields(_Doubles, "box_low box_high box_aside separation braking_separation pair_aside"),
        *_fields(_Flags, "link"),
        *_fields(_Doubles, "cell radius"),
        *_fields(_Integers, "demand_cell demand_magnitude demand_looks"),
        *_fields(_Doubles, "demand_weight"),
        *_fields(_Integers, "lag"),
        *_fields(_Doubles, "lag_part"),
        *_fields(_Flags, "fixed"),
    ]


class Options(Structure):
    """Parameters of the descent; see `src/problem.h`."""

    _fields_ = [
        *_fields(c_int32, "stages iterations stage_iterations samples"),
        *_fields(_Doubles, "sharpness floor overshoot"),
        *_fields(c_double, "margin penalty proximal barrier step_max small_step least_room"),
        *_fields(c_double, "feasibility limit_feasibility input_feasibility braking_tolerance braking_cost"),
        *_fields(c_double, "tie deadline_s"),
        *_fields(c_void_p, "potrf potrs"),
    ]


class Found(Structure):
    """What a descent found; see `src/problem.h`."""

    _fields_ = [
        *_fields(c_double, "cost violation braking"),
        *_fields(c_int32, "iterations stage outcome"),
    ]


@lru_cache(maxsize=1)
def library() -> ctypes.CDLL | None:
    """Return the compiled library, or None where it was not built."""
    if not LIBRARY.exists():
        return None
    try:
        found = ctypes.CDLL(str(LIBRARY))
    except OSError:
        return None
    found.coverage_descent.argtypes = [POINTER(Problem), POINTER(Options), c_void_p, POINTER(Found)]
    found.coverage_evaluate.argtypes = [POINTER(Problem), POINTER(Options), c_void_p, POINTER(Found)]
    return found


@lru_cache(maxsize=1)
def _cython_lapack() -> ModuleType:
    """Return SciPy's table of LAPACK routines: its extension alone, as all of `scipy.linalg` takes 0.1 s to import."""
    (folder,) = vars(scipy)["__path__"]
    path = next(Path(folder, "linalg").glob("cython_lapack.*"))
    name = "scipy.linalg.cython_lapack"
    loader = ExtensionFileLoader(name, str(path))
    spec = spec_from_loader(name, loader)
    assert spec is not None
    module = module_from_spec(spec)
    loader.exec_module(module)
    return module


@lru_cache(maxsize=4)
def lapack(name: str) -> int:
    """Return the address of a LAPACK routine that SciPy exports."""
    capsule: Any = vars(_cython_lapack())["__pyx_capi__"][name]
    api = ctypes.pythonapi
    api.PyCapsule_GetName.restype, api.PyCapsule_GetName.argtypes = ctypes.c_char_p, [ctypes.py_object]
    api.PyCapsule_GetPointer.restype = c_void_p
    api.PyCapsule_GetPointer.argtypes = [ctypes.py_object, ctypes.c_char_p]
    return int(api.PyCapsule_GetPointer(capsule, api.PyCapsule_GetName(capsule)))


def descend(problem: Problem, options: Options, x: NDArray[np.float64]) -> tuple[NDArray[np.float64], Found]:
    """Return the variables of the best motion found from `x`, which is not changed, and what is known of it."""
    return _called("coverage_descent", problem, options, x)


def evaluate(problem: Problem, options: Options, x: NDArray[np.float64]) -> Found:
    """Return cost and violations of a motion, as the descent sees them."""
    return _called("coverage_evaluate", problem, options, x)[1]


def _called(name: str, problem: Problem, options: Options, x: NDArray[np.float64]) -> tuple[NDArray[np.float64], Found]:
    """Call a function of the library on a copy of the variables; return these and what it found."""
    native = library()
    assert native is not None
    found, start = Found(), np.array(x, dtype=np.float64)
    getattr(native, name)(problem, options, start.ctypes.data, found)
    return start, found
