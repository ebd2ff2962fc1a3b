"""Weight maps from files, embedded in the mission so that it needs no other file."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpc_cover.errors import InvalidInputError, Problem

if TYPE_CHECKING:
    from pathlib import Path

    from mpc_cover.arrays import FloatArray


def with_weights(raw: object, folder: Path, what: str) -> object:
    """Return the raw mission with `area.weights.file` replaced by the values it holds.

    Raises
    ------
    InvalidInputError
        The file is missing, or holds no plane of finite weights that are not negative.
    """
    area = raw.get("area") if isinstance(raw, dict) else None
    weights = area.get("weights") if isinstance(area, dict) else None
    if not isinstance(weights, dict) or not isinstance(name := weights.get("file"), str) or "values" in weights:
        return raw
    try:
        values = read_weights(folder / name)
    except Exception as error:  # noqa: BLE001 - readers let through whatever a corrupt file makes them raise
        detail = " ".join(str(error).split()) or type(error).__name__
        problem = Problem("area.weights.file", name, f"cannot be read as weights: {detail}")
        raise InvalidInputError(what, [problem]) from None
    assert isinstance(raw, dict)
    assert isinstance(area, dict)
    others = {key: value for key, value in weights.items() if key != "file"}
    return {**raw, "area": {**area, "weights": {**others, "values": values.tolist()}}}


def read_weights(path: Path) -> FloatArray:
    """Return (X, Y) weights from an `.npy` array, or an image's brightness from 0 to 1 with y upward.

    Raises
    ------
    OSError, ValueError
        Unreadable, not a plane, or with values that are negative or not finite.
    """
    values = np.load(path, allow_pickle=False) if path.suffix == ".npy" else _brightness(path)
    if values.ndim != 2 or values.size == 0 or values.dtype.kind not in "fiub":  # noqa: PLR2004 - a plane
        raise ValueError(f"must be a plane of numbers, got {values.dtype} of shape {values.shape}")
    weights = np.asarray(values, dtype=float)
    if not np.isfinite(weights).all() or (weights < 0.0).any():
        raise ValueError("weights must be finite and not negative")
    return weights


def _brightness(path: Path) -> FloatArray:
    from matplotlib.image import imread  # noqa: PLC0415 - only images need it

    image = np.asarray(imread(path), dtype=float)
    grey = image[..., :3].mean(axis=2) if image.ndim == 3 else image  # noqa: PLR2004 - colour planes
    scaled = grey / 255.0 if grey.max(initial=0.0) > 1.0 else grey
    return np.asarray(scaled[::-1].T)
