"""LIC-1: the start with the highest estimated probability of success (paper III-A, III-E)."""

import time

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from lic_drake.errors import RequestError
from lic_drake.estimate.estimator import SuccessEstimator
from lic_drake.estimate.features import FeatureMap
from lic_drake.robots.planar import PlanarArm
from lic_drake.select.baselines import make_selection
from lic_drake.select.program import StartProgram
from lic_drake.select.situation import Selection, Situation

Vector = NDArray[np.float64]

NUM_SOLVES = 6
"""Starting points of the optimisation: the best of the library's starts and of a lattice."""


class LicSelector:
    """Selects by optimising an estimator with a MathematicalProgram from many starts.

    The answer is never worse than the best candidate seen, whatever the solver reports, and is
    checked with the closed-form inverse kinematics.
    """

    def __init__(
        self,
        arm: PlanarArm,
        estimator: SuccessEstimator,
        features: FeatureMap,
        method: str = "lic",
    ) -> None:
        self.method = method
        self._arm = arm
        self.estimator = estimator
        self._features = features
        self._program = StartProgram(arm.kinematics, estimator, features)

    def select(self, situation: Situation) -> Selection:
        """Returns the best start found.

        Raises:
            RequestError: No start is left away from the failed ones.
        """
        began = time.perf_counter()
        candidates = self._candidates(situation)
        values = self.evaluate(situation.p_WG, candidates)
        order = np.argsort(-values, kind="stable")
        best, best_value = candidates[order[0]], float(values[order[0]])
        for guess in candidates[order[:NUM_SOLVES]]:
            x0 = self._improve(situation, guess)
            if x0 is None:
                continue
            value = float(self.evaluate(situation.p_WG, x0[None])[0])
            if value > best_value:
                best, best_value = x0, value
        probability = float(np.clip(best_value, 0.0, 1.0))
        return make_selection(situation, best, probability, self.method, began)

    def evaluate(self, p_WG: Vector, x0: Vector) -> Vector:
        """Returns the unclipped estimate at start poses, shape (n, 3) -> (n,)."""
        Z = self._features.join(p_WG, x0)
        return np.array([self.estimator.value_and_gradient(z)[0] for z in Z])

    def _candidates(self, situation: Situation) -> Vector:
        """Returns the library's own starts and a lattice, without those near failed starts."""
        candidates = np.vstack([situation.starts.grid, situation.starts.lattice])
        candidates = candidates[situation.allowed(candidates)]
        if len(candidates) == 0:
            raise RequestError("no start is left away from the failed ones")
        return candidates

    def _improve(self, situation: Situation, guess: Vector) -> Vector | None:
        """Returns the pose that the optimisation reaches from a guess, None if impossible."""
        q = self._arm.solve_ik(guess)
        if q is None:
            return None
        line = situation.starts.line
        lower, upper = line.lower.copy(), line.upper.copy()
        lower[1], upper[1] = next(
            (low, high)
            for low, high in situation.free_intervals()
            if low - 1e-5 <= guess[1] <= high + 1e-5
        )
        x0 = self._program.solve(situation.p_WG, lower, upper, guess, q)
        x0 = np.clip(x0, lower, upper)
        return x0 if situation.starts.contains(x0) else None


class LbfgsbSelector(LicSelector):
    """The paper's own optimiser: L-BFGS-B, which knows bounds only (III-E).

    The orientations that the joint limits leave depend on the position, so it works on
    (y, s) with phi = low(y) + s (high(y) - low(y)) and s from 0 to 1.
    """

    def _improve(self, situation: Situation, guess: Vector) -> Vector | None:
        starts = situation.starts
        low, high = next(
            (low, high)
            for low, high in situation.free_intervals()
            if low - 1e-5 <= guess[1] <= high + 1e-5
        )

        def pose(y_s: Vector) -> tuple[Vector, Vector]:
            """Returns x0 and its derivative by (y, s), shape (3, 2)."""
            ends, slopes = starts.phi_range(y_s[0])
            width, d_width = ends[1] - ends[0], slopes[1] - slopes[0]
            x0 = np.array([starts.line.x_m, y_s[0], ends[0] + y_s[1] * width])
            by_y_s = np.array([[0.0, 0.0], [1.0, 0.0], [slopes[0] + y_s[1] * d_width, width]])
            return x0, by_y_s

        def cost(y_s: Vector) -> tuple[float, Vector]:
            x0, by_y_s = pose(y_s)
            z = self._features.join(situation.p_WG, x0)
            value, by_z = self.estimator.value_and_gradient(z)
            return -value, -self._features.gradient_by_x0(by_z) @ by_y_s

        ends, _ = starts.phi_range(guess[1])
        share = (guess[2] - ends[0]) / max(ends[1] - ends[0], 1e-9)
        result = minimize(
            cost,
            np.array([guess[1], np.clip(share, 0.0, 1.0)]),
            jac=True,
            method="L-BFGS-B",
            bounds=[(low, high), (0.0, 1.0)],
        )
        x0, _ = pose(result.x)
        return x0 if starts.contains(x0) else None
