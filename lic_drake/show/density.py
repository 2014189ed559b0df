"""The estimated probability of success over all starts (paper Fig. 6), as numbers."""

import numpy as np

from lic_drake.reach.start import Starts
from lic_drake.reach.starts import PlanarStarts, Region
from lic_drake.select.lic import LicSelector
from lic_drake.select.situation import Situation
from lic_drake.types import Vector

DENSITY_SHAPE = (81, 91)
"""Lattice of a density: y every 1 cm, phi every 2 degrees."""


def density_lattice(starts: PlanarStarts, region: Region) -> tuple[Starts, tuple[int, int]]:
    """Returns initial conditions over a whole start line, possible or not, and their shape.

    Where the base moves, the hand is in the centre of an aperture and the base varies; relative to
    the base these are the same poses.

    Args:
        starts: The possible ones.
        region: One of their regions: the line, or an aperture.

    Returns:
        n initial conditions of which phi varies fastest, and the numbers of y and phi values.
    """
    line = starts.poses.line
    y = np.linspace(line.lower[1], line.upper[1], DENSITY_SHAPE[0])
    phi = np.linspace(line.lower[2], line.upper[2], DENSITY_SHAPE[1])
    poses = np.array([[line.x_m, yi, phi_i] for yi in y for phi_i in phi])
    if region.lower[1] < region.upper[1]:
        return Starts(poses, np.zeros((len(poses), 3))), DENSITY_SHAPE
    p_WA = region.lower[:2]
    b0 = np.column_stack([p_WA - poses[:, :2], np.zeros(len(poses))])
    return Starts(poses + b0, b0), DENSITY_SHAPE


def estimate_density(selector: LicSelector, situation: Situation, conditions: Starts) -> Vector:
    """Returns the estimates at n initial conditions, shape (n,), NaN where the arm cannot start."""
    arm = situation.planar_starts.poses.arm
    possible = np.array([arm.solve_ik(x0) is not None for x0 in conditions.in_R])
    density = np.full(len(possible), np.nan)
    objective = selector.objective(situation)
    density[possible] = np.clip(objective.values(conditions.take(possible)), 0.0, 1.0)
    return density
