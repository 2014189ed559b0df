"""LIC's optimisation for a planar arm."""

from collections.abc import Iterator

import numpy as np
from scipy.optimize import minimize

from lic_drake.reach.start import Starts
from lic_drake.reach.starts import Region, find_region, is_possible
from lic_drake.robots.arm import Arm
from lic_drake.select.lic import LicSelector
from lic_drake.select.objective import SuccessModel, SuccessObjective
from lic_drake.select.planar_program import PlanarProgram
from lic_drake.select.situation import Situation
from lic_drake.types import Vector

NUM_SOLVES = 6
"""Starting points of the optimisation: the best of the library's starts and of a lattice."""


class PlanarLic(LicSelector):
    """Optimises with a MathematicalProgram from the best starts of the grid and of a lattice."""

    def __init__(
        self,
        arm: Arm,
        first: SuccessModel,
        second: SuccessModel | None = None,
        method: str = "lic",
    ) -> None:
        """Sets up a selector for an arm; see `LicSelector`."""
        super().__init__(first, second, method)
        self._arm = arm
        self._program = PlanarProgram(arm.kinematics)

    def _candidates(self, situation: Situation) -> Starts:
        return situation.planar_starts.grid.join(situation.planar_starts.lattice)

    def _improve(
        self,
        situation: Situation,
        objective: SuccessObjective,
        candidates: Starts,
        values: Vector,
    ) -> Iterator[Starts]:
        starts = situation.planar_starts
        regions = starts.regions if objective.failed else situation.free_regions()
        for i in np.argsort(-values, kind="stable")[:NUM_SOLVES]:
            improved = self._solve(
                situation, objective, regions, candidates.x0[i], candidates.b0[i, :2]
            )
            if improved is not None:
                yield improved

    def _solve(
        self,
        situation: Situation,
        objective: SuccessObjective,
        regions: tuple[Region, ...],
        x0: Vector,
        p_WR: Vector,
    ) -> Starts | None:
        """Returns where the optimisation ends from a candidate, None if that is not possible."""
        region = find_region(regions, x0, p_WR)
        q = self._arm.solve_ik(x0 - [*p_WR, 0.0])
        # A candidate just beside the end of a region is one that nothing can improve.
        if not len(q) or region is None:
            return None
        x0, p_WR = self._program.solve(objective, region, x0, p_WR, q[0])
        x0 = np.clip(x0, region.lower, region.upper)
        p_WR = np.clip(p_WR, region.base_lower, region.base_upper)
        if not is_possible(situation.planar_starts, x0, p_WR):
            return None
        return Starts(x0[None], np.array([[*p_WR, 0.0]]))


class PlanarLbfgsb(PlanarLic):
    """The paper's own optimiser: L-BFGS-B, which knows bounds only (III-E).

    The orientations that the joint limits leave depend on the hand's position y relative to the
    base, so it works on (y, s) with phi = low(y) + s (high(y) - low(y)) and s from 0 to 1.
    """

    def _solve(
        self,
        situation: Situation,
        objective: SuccessObjective,
        regions: tuple[Region, ...],
        x0: Vector,
        p_WR: Vector,
    ) -> Starts | None:
        poses = situation.planar_starts.poses
        region = find_region(regions, x0, p_WR)
        if region is None:
            return None
        # Moving the base to the left moves the hand to the right of it.
        y_low = max(region.lower[1] - region.base_upper[1], poses.y_range[0])
        y_high = min(region.upper[1] - region.base_lower[1], poses.y_range[1])
        if y_low > y_high:
            return None
        base_moves = region.base_lower[1] < region.base_upper[1]

        def condition(y_s: Vector) -> tuple[Vector, Vector, Vector, Vector]:
            """Returns x0 and the base, and their derivatives by (y, s), (3, 2) and (2, 2)."""
            ends, slopes = poses.phi_range(y_s[0])
            width, d_width = ends[1] - ends[0], slopes[1] - slopes[0]
            phi = ends[0] + y_s[1] * width
            by_y = 0.0 if base_moves else 1.0
            y_base = x0[1] - y_s[0] if base_moves else p_WR[1]
            return (
                np.array([x0[0], y_base + y_s[0], phi]),
                np.array([p_WR[0], y_base]),
                np.array([[0.0, 0.0], [by_y, 0.0], [slopes[0] + y_s[1] * d_width, width]]),
                np.array([[0.0, 0.0], [by_y - 1.0, 0.0]]),
            )

        def cost(y_s: Vector) -> tuple[float, Vector]:
            pose, base, pose_by, base_by = condition(y_s)
            value, by_x0, by_b0 = objective.value_and_gradient(pose, np.append(base, 0.0))
            return -value, -(by_x0 @ pose_by + by_b0[:2] @ base_by)

        y = x0[1] - p_WR[1]
        ends, _ = poses.phi_range(y)
        share = (x0[2] - ends[0]) / max(ends[1] - ends[0], 1e-9)
        result = minimize(
            cost,
            np.array([np.clip(y, y_low, y_high), np.clip(share, 0.0, 1.0)]),
            jac=True,
            method="L-BFGS-B",
            bounds=[(y_low, y_high), (0.0, 1.0)],
        )
        x0, p_WR, _, _ = condition(result.x)
        if not is_possible(situation.planar_starts, x0, p_WR):
            return None
        return Starts(x0[None], np.array([[*p_WR, 0.0]]))
