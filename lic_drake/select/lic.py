"""LIC-1 and LIC-2: the start with the highest estimated probability of success (paper III)."""

import time

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from lic_drake.errors import RequestError
from lic_drake.estimate.checks import EstimateError
from lic_drake.reach.starts import InitialConditions, Region, find_region, is_possible
from lic_drake.robots.planar import PlanarArm
from lic_drake.select.baselines import make_selection
from lic_drake.select.objective import Objective, SuccessModel
from lic_drake.select.program import StartProgram
from lic_drake.select.situation import FailedReach, Selection, Situation

Vector = NDArray[np.float64]

NUM_SOLVES = 6
"""Starting points of the optimisation: the best of the library's starts and of a lattice."""


class LicSelector:
    """Selects by optimising an estimator with a MathematicalProgram from many starts.

    A first attempt is chosen with LIC-1, a further one with LIC-2, which knows how the attempts
    before it failed. Without LIC-2, further attempts are LIC-1's best away from the failed ones.

    The answer is never worse than the best candidate seen, whatever the solver reports, and is
    checked with the closed-form inverse kinematics.
    """

    def __init__(
        self,
        arm: PlanarArm,
        first: SuccessModel,
        second: SuccessModel | None = None,
        method: str = "lic",
    ) -> None:
        """Sets up a selector.

        Args:
            arm: The robot.
            first: LIC-1's fitted model.
            second: LIC-2's, if there is one.
            method: Name for the selections.
        """
        self.method = method
        self.first = first
        self.second = second
        self._arm = arm
        self._program = StartProgram(arm.kinematics)

    def select(self, situation: Situation) -> Selection:
        """Returns the best start found.

        Raises:
            RequestError: No start is left away from the failed ones.
        """
        began = time.perf_counter()
        objective, regions = self._pose(situation)
        candidates = situation.starts.grid.join(situation.starts.lattice)
        if not objective.failed:
            candidates = candidates.take(situation.allowed(candidates))
        if len(candidates.x0) == 0:
            raise RequestError("no start is left away from the failed ones")
        values = objective.values(candidates)
        order = np.argsort(-values, kind="stable")
        best = candidates.take(order[:1])
        best_value = float(values[order[0]])
        for i in order[:NUM_SOLVES]:
            improved = self._improve(
                situation, objective, regions, candidates.x0[i], candidates.p_WR[i]
            )
            if improved is None:
                continue
            value = float(objective.values(improved)[0])
            if value > best_value:
                best, best_value = improved, value
        probability = float(np.clip(best_value, 0.0, 1.0))
        return make_selection(situation, best.x0[0], best.p_WR[0], probability, self.method, began)

    def objective(self, situation: Situation) -> Objective:
        """Returns what is maximised in a situation."""
        return self._pose(situation)[0]

    def _pose(self, situation: Situation) -> tuple[Objective, tuple[Region, ...]]:
        """Returns the objective and where it is maximised."""
        seen = self._observable(situation.failed)
        if self.second is not None and seen:
            objective = Objective(model=self.second, p_WG=situation.p_WG, failed=seen)
            return objective, situation.starts.regions
        return Objective(model=self.first, p_WG=situation.p_WG), situation.free_regions()

    def _observable(self, failed: tuple[FailedReach, ...]) -> tuple[FailedReach, ...]:
        """Returns the failures that show all that LIC-2 asks for: those that began at all."""
        if self.second is None:
            return ()
        seen = []
        for reach in failed:
            try:
                self.second.features.observation(reach.shown)
            except EstimateError:
                continue
            seen.append(reach)
        return tuple(seen)

    def _improve(
        self,
        situation: Situation,
        objective: Objective,
        regions: tuple[Region, ...],
        x0: Vector,
        p_WR: Vector,
    ) -> InitialConditions | None:
        """Returns where the optimisation ends from a candidate, None if that is not possible."""
        region = find_region(regions, x0, p_WR)
        q = self._arm.solve_ik(x0 - [*p_WR, 0.0])
        # A candidate just beside the end of a region is one that nothing can improve.
        if q is None or region is None:
            return None
        x0, p_WR = self._program.solve(objective, region, x0, p_WR, q)
        x0 = np.clip(x0, region.lower, region.upper)
        p_WR = np.clip(p_WR, region.base_lower, region.base_upper)
        if not is_possible(situation.starts, x0, p_WR):
            return None
        return InitialConditions(x0[None], p_WR[None])


class LbfgsbSelector(LicSelector):
    """The paper's own optimiser: L-BFGS-B, which knows bounds only (III-E).

    The orientations that the joint limits leave depend on the hand's position y relative to the
    base, so it works on (y, s) with phi = low(y) + s (high(y) - low(y)) and s from 0 to 1.
    """

    def _improve(
        self,
        situation: Situation,
        objective: Objective,
        regions: tuple[Region, ...],
        x0: Vector,
        p_WR: Vector,
    ) -> InitialConditions | None:
        poses = situation.starts.poses
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
            value, by_x0, by_b0 = objective.value_and_gradient(pose, base)
            return -value, -(by_x0 @ pose_by + by_b0 @ base_by)

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
        if not is_possible(situation.starts, x0, p_WR):
            return None
        return InitialConditions(x0[None], p_WR[None])
