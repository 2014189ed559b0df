"""Places of base and torso before a board of apertures that are compared before solving."""

from itertools import product

import numpy as np

from lic_drake.reach.pointing_starts import PointingStarts
from lic_drake.reach.start import Starts
from lic_drake.reach.task import Stand
from lic_drake.types import Vector

LATTICE_M = 0.025
"""Largest distance of neighbouring places of the base and heights of the torso in a lattice."""

_DECIMALS = 6
"""To the micrometre, as places are chosen: what is equal but for rounding is one place."""


def make_lattice(starts: PointingStarts, x0: Vector) -> Starts:
    """Returns places all over the stand for one tool pose, shape (7,).

    Among them are all from which the robot has this aperture where it had one when it learned: the
    L1 kernel has kinks there, and the process its peaks.
    """
    stand, apart = starts.stand, x0[:3] - starts.all_apertures
    learned_y = np.add.outer(apart[:, 1], stand.training_y_m)
    learned_torso = np.add.outer(apart[:, 2], stand.training_torso_m)
    y = _steps(stand.y_min_m, stand.y_max_m, learned_y)
    torso = _steps(stand.torso_min_m, stand.torso_max_m, learned_torso)
    places = np.array(list(product(y, torso)))
    return _standing(np.tile(x0, (len(places), 1)), places)


def find_neighbours(stand: Stand, places: Starts, step_m: float) -> Starts:
    """Returns the eight neighbours of each place, a step away along y, torso or both, each once."""
    steps = np.array(list(product((-step_m, 0.0, step_m), repeat=2)))
    steps = steps[np.any(steps != 0.0, axis=1)]
    y_torso = places.b0[:, None, 1:] + steps
    low = [stand.y_min_m, stand.torso_min_m]
    high = [stand.y_max_m, stand.torso_max_m]
    y_torso = np.round(np.clip(y_torso, low, high), _DECIMALS).reshape(-1, 2)
    x0 = np.repeat(places.x0, len(steps), axis=0)
    _, first = np.unique(np.hstack([x0, y_torso]), axis=0, return_index=True)
    return _standing(x0[first], y_torso[first])


def _steps(low: float, high: float, more: Vector) -> Vector:
    """Returns numbers from low to high in equal steps, and those of more between them, in order."""
    row = np.linspace(low, high, int(np.ceil((high - low) / LATTICE_M - 1e-9)) + 1)
    inside = more[(more > low) & (more < high)]
    return np.unique(np.round(np.append(row, inside), _DECIMALS))


def _standing(x0: Vector, y_torso: Vector) -> Starts:
    """Returns tool poses, shape (n, 7), from y and height of the torso, shape (n, 2), metres."""
    return Starts(x0, np.column_stack([np.zeros(len(x0)), y_torso]))
