"""The paper's own optimiser, L-BFGS-B (III-E), beside the MathematicalProgram."""

import numpy as np
from scipy.optimize import minimize

from lic_drake.reach.start import Start
from lic_drake.select.lic import LicSelector
from lic_drake.select.program import LicProgram
from lic_drake.starts import Region
from lic_drake.types import Vector

BISECTIONS = 20
"""So often the way to an end that the arm cannot reach is halved."""


class LbfgsbSelector(LicSelector):
    """Optimises over the box of a region with L-BFGS-B, which knows nothing of the arm.

    Free are the base, the torso and, in the plane, position and direction of the hand; in space the
    hand keeps its pose. Where the arm cannot start where the optimisation ends, it starts on the
    straight way there, as far along as it can. Constraints that were added to the program are
    checked only.
    """

    def improve(self, program: LicProgram, region: Region, start: Start) -> Start | None:
        """Returns where the optimisation ends from a start; see `LicSelector.improve`."""
        starts = program.situation.starts
        pose = len(start.x0)
        lower, upper = (
            np.append(region.lower, region.b0_lower),
            np.append(region.upper, region.b0_upper),
        )
        if pose > 3:
            lower[:pose] = upper[:pose] = start.x0
        free = np.flatnonzero(lower < upper)
        begin = np.append(start.x0, start.b0)

        def at(z: Vector) -> tuple[Vector, Vector]:
            x0_b0 = begin.copy()
            x0_b0[free] = z
            return x0_b0[:pose], x0_b0[pose:]

        def cost(z: Vector) -> tuple[float, Vector]:
            value, by_x0, by_b0 = program.objective.value_and_gradient(*at(z))
            return -value, -np.append(by_x0, by_b0)[free]

        def feasible(share: float) -> Start | None:
            x0, b0 = at(begin[free] + share * (end - begin[free]))
            return starts.snap(region, Start(x0, b0, start.q))

        bounds = list(zip(lower[free], upper[free], strict=True))
        end = minimize(cost, begin[free], jac=True, method="L-BFGS-B", bounds=bounds).x
        found, low, high = feasible(1.0), 0.0, 1.0
        if found is not None:
            return found
        for _ in range(BISECTIONS):
            middle = 0.5 * (low + high)
            here = feasible(middle)
            found, low, high = (found, low, middle) if here is None else (here, middle, high)
        return found
