"""Validation of the arrays of a QP; each error names the field and the index."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import scipy

if TYPE_CHECKING:
    from numpy.typing import NDArray

INFINITE = 1e20
"""A bound of this magnitude or more counts as infinite, in all back-ends alike; a plain choice."""


class InvalidQPError(ValueError):
    """Invalid QP data; the message names the field, the index and what is expected."""


def column_of_each_entry(matrix: scipy.sparse.csc_array[np.float64]) -> NDArray[np.intp]:
    """Return the column of each stored entry: (nnz,)."""
    return np.repeat(np.arange(matrix.shape[1]), np.diff(matrix.indptr))


def check_finite(name: str, values: NDArray[np.float64], size: int) -> None:
    """Raise `InvalidQPError` unless `values` are `size` finite doubles."""
    check_vector(name, values, size)
    if not np.isfinite(values).all():
        where = int(np.flatnonzero(~np.isfinite(values))[0])
        raise InvalidQPError(f"{name}[{where}] = {values[where]}: must be finite")


def check_vector(name: str, values: NDArray[np.float64], size: int) -> None:
    """Raise `InvalidQPError` unless `values` are `size` doubles."""
    if not isinstance(values, np.ndarray) or values.dtype != np.float64 or values.shape != (size,):
        found = f"{getattr(values, 'dtype', type(values).__name__)} {np.shape(values)}"
        raise InvalidQPError(f"{name}: needs float64 ({size},), got {found}")


def check_matrix(name: str, matrix: scipy.sparse.csc_array[np.float64], shape: tuple[int, int]) -> None:
    """Raise `InvalidQPError` unless `matrix` is a finite canonical csc_array of doubles of this shape."""
    if not isinstance(matrix, scipy.sparse.csc_array) or matrix.dtype != np.float64:
        raise InvalidQPError(f"{name}: needs a float64 csc_array, got {type(matrix).__name__}")
    if matrix.shape != shape:
        raise InvalidQPError(f"{name}: needs shape {shape}, got {matrix.shape}")
    try:
        matrix.check_format(full_check=True)
    except ValueError as error:
        raise InvalidQPError(f"{name}: {error}") from error
    steps = np.diff(matrix.indices) <= 0
    # indices may decrease only where a new column begins
    begins = matrix.indptr[1:-1]
    steps[begins[(begins > 0) & (begins < matrix.nnz)] - 1] = False
    if steps.any():
        raise InvalidQPError(f"{name}: row indices must increase within each column (sort, sum duplicates)")
    check_finite(f"{name}.data", matrix.data, matrix.nnz)


def check_diagonal(data: NDArray[np.float64], diagonal: NDArray[np.intp]) -> None:
    """Raise `InvalidQPError` if a diagonal entry of P, at these indices of its data, is negative."""
    values = data[diagonal]
    if (values < 0.0).any():
        raise InvalidQPError(f"P: not positive semi-definite, it has {values.min()} on its diagonal")


def check_bounds(lower: NDArray[np.float64], upper: NDArray[np.float64], m: int) -> None:
    """Raise `InvalidQPError`, naming the row, unless l <= u and each admits a finite A x."""
    check_vector("l", lower, m)
    check_vector("u", upper, m)
    for name, values, wrong in (("l", lower, lower >= INFINITE), ("u", upper, upper <= -INFINITE)):
        if (bad := np.flatnonzero(np.isnan(values) | wrong)).size:
            raise InvalidQPError(f"{name}[{bad[0]}] = {values[bad[0]]}: no finite value satisfies it")
    if (bad := np.flatnonzero(lower > upper)).size:
        row = bad[0]
        raise InvalidQPError(f"row {row}: l[{row}] = {lower[row]} is above u[{row}] = {upper[row]}")
