"""Array types for annotations, and the check of their shapes."""

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]
"""Real numbers; each docstring states shape and unit."""
BoolVector = NDArray[np.bool_]
"""Truth values, for instance a mask."""
IntVector = NDArray[np.intp]
"""Integers, for instance indices."""


def check_shapes(arrays: object, **shapes: tuple[int | None, ...]) -> None:
    """Checks the shapes of an object's arrays; an attribute that is None fits.

    Args:
        arrays: The object.
        shapes: Expected shape of each attribute; None stands for any length.

    Raises:
        ValueError: A shape does not fit.
    """
    for name, expected in shapes.items():
        value = getattr(arrays, name)
        shape = np.shape(value)
        fits = len(shape) == len(expected) and all(
            want in (None, have) for have, want in zip(shape, expected, strict=True)
        )
        if value is not None and not fits:
            raise ValueError(f"{name} has shape {shape}, expected {expected}")
