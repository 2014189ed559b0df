"""Names for the NumPy array types in annotations."""

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]
"""Real numbers; each docstring states shape and unit."""
BoolVector = NDArray[np.bool_]
"""Truth values, for instance a mask."""
IntVector = NDArray[np.intp]
"""Integers, for instance indices."""
