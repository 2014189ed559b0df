"""Array types for annotations, and a check of shapes."""

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]
"""Real numbers; docstrings state shape and unit."""
BoolVector = NDArray[np.bool_]
"""Booleans, such as a mask."""
IntVector = NDArray[np.intp]
"""Integers, such as indices."""


def check_shapes(arrays: object, **shapes: tuple[int | None, ...]) -> None:
    """Raises a ValueError if an array attribute, unless it is None, has another shape.

    A length of None matches any.
    """
    for name, expected in shapes.items():
        value = getattr(arrays, name)
        shape = np.shape(value)
        fits = len(shape) == len(expected) and all(
            want in (None, have) for have, want in zip(shape, expected, strict=True)
        )
        if value is not None and not fits:
            raise ValueError(f"{name} has shape {shape}, expected {expected}")
