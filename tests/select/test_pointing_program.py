"""The PR2's program with a smooth objective of which the optimum is known."""

import numpy as np
import pytest
from pydrake.autodiffutils import AutoDiffXd, ExtractGradient, InitializeAutoDiff
from support.pr2_reaches import SCENARIO

from lic_drake.estimate.features import FeatureMap
from lic_drake.reach.pointing_starts import PointingStarts
from lic_drake.reach.starts import make_starts
from lic_drake.select.objective import Objective, SuccessModel
from lic_drake.select.pointing_program import CLEARANCE_M, PointingProgram

IN_SPACE = FeatureMap(goal=("goal_y", "goal_z"), start=("start_y", "start_z", "start_qx"))


class Hill:
    """A paraboloid over the features (goal y, z; start y, z, qx) with its top at `top`."""

    def __init__(self, top: np.ndarray, weight: np.ndarray) -> None:
        self.top, self.weight = top, weight

    def values(self, Z: np.ndarray) -> np.ndarray:
        return np.asarray(1.0 - (Z - self.top) ** 2 @ self.weight)

    def value_and_gradient(self, z: np.ndarray) -> tuple[float, np.ndarray]:
        return float(self.values(z[None])[0]), -2.0 * self.weight * (z - self.top)


STARTS = make_starts(SCENARIO, SCENARIO.sample_instance("holdout", 0))
assert isinstance(STARTS, PointingStarts)
PROGRAM = PointingProgram(STARTS)
P_WG = np.array([0.84, -0.2, 0.9])


def objective(top_y: float, top_z: float, qx: float | None = None) -> Objective:
    """Wants the start at a place relative to b0, and, if given, a roll of the tool."""
    top = np.array([0.0, 0.0, top_y, top_z, 0.0 if qx is None else qx])
    weight = np.array([0.0, 0.0, 1.0, 1.0, 0.0 if qx is None else 0.1])
    model = SuccessModel(estimator=Hill(top, weight), features=IN_SPACE)  # type: ignore[arg-type]
    return Objective(model=model, p_WG=P_WG)


@pytest.mark.parametrize("k", [3, 200, 431, 640])
def test_base_and_torso_bring_the_aperture_to_the_best_place(k: int) -> None:
    x0, b0, q = STARTS.grid.x0[k], STARTS.grid.b0[k], STARTS.grid_angles[k]
    best_b0 = np.clip(b0 + [0.0, 0.03, -0.02], [0.0, -0.3, 0.0115], [0.0, 0.3, 0.305])
    wanted = x0[:3] - best_b0
    found_b0, found_q = PROGRAM.solve(objective(wanted[1], wanted[2]), x0[:3], b0, q)
    np.testing.assert_allclose(found_b0, best_b0, atol=1e-3)
    pose = PROGRAM.tool_pose(found_b0, found_q)
    np.testing.assert_allclose(pose[:3], x0[:3], atol=1e-5)
    np.testing.assert_allclose(pose[5:], 0.0, atol=1e-5)


def test_the_range_of_base_and_torso_is_kept() -> None:
    k = 300
    x0, b0, q = STARTS.grid.x0[k], STARTS.grid.b0[k], STARTS.grid_angles[k]
    far = x0[:3] - [0.0, 5.0, 5.0]
    found_b0, _ = PROGRAM.solve(objective(far[1], far[2]), x0[:3], b0, q)
    assert found_b0[0] == 0.0
    assert -0.3 - 1e-9 <= found_b0[1] <= 0.3 + 1e-9
    assert 0.0115 - 1e-9 <= found_b0[2] <= 0.305 + 1e-9


def test_the_tool_rolls_where_that_is_estimated_to_help() -> None:
    k = 300
    x0, b0, q = STARTS.grid.x0[k], STARTS.grid.b0[k], STARTS.grid_angles[k]
    here = x0[:3] - b0
    wanted = x0[4] - 0.1
    found_b0, found_q = PROGRAM.solve(objective(here[1], here[2], wanted), x0[:3], b0, q)
    assert PROGRAM.tool_pose(found_b0, found_q)[4] == pytest.approx(wanted, abs=1e-3)


@pytest.mark.parametrize("k", [10, 350])
def test_the_gradients_of_cost_and_tool_are_those_of_finite_differences(k: int) -> None:
    PROGRAM._objective, PROGRAM._p_WA = objective(-0.3, 0.7, 0.2), STARTS.grid.x0[k, :3]
    rng = np.random.default_rng(k)
    at = np.concatenate([[0.0, 0.05, 0.0, 0.1], STARTS.grid_angles[k]])
    at += np.r_[0.0, 0.01, 0.0, 0.01, 0.02 * np.ones(7)] * rng.normal(size=11)
    cost = PROGRAM._cost(InitializeAutoDiff(at).ravel())
    assert isinstance(cost, AutoDiffXd)
    errors = ExtractGradient(PROGRAM._tool_error(InitializeAutoDiff(at).ravel()))
    for j in (0, 1, 3, *range(4, 11)):
        step = np.zeros(11)
        step[j] = 1e-6
        slope = (PROGRAM._cost(at + step) - PROGRAM._cost(at - step)) / 2e-6
        assert cost.derivatives()[j] == pytest.approx(slope, abs=1e-6)
        slopes = (PROGRAM._tool_error(at + step) - PROGRAM._tool_error(at - step)) / 2e-6
        np.testing.assert_allclose(errors[:, j], slopes, atol=1e-6)


def test_the_arm_keeps_its_distance() -> None:
    """Drake's own distance query, at an answer, on the checker's plant."""
    k = 120
    x0, b0, q = STARTS.grid.x0[k], STARTS.grid.b0[k], STARTS.grid_angles[k]
    here = x0[:3] - b0
    found_b0, found_q = PROGRAM.solve(objective(here[1] - 0.02, here[2]), x0[:3], b0, q)
    plant, context = STARTS.checker.plant, STARTS.checker.plant_context
    positions = np.concatenate([[found_b0[0], found_b0[1], 0.0, found_b0[2]], found_q])
    plant.SetPositions(context, positions)
    query = plant.get_geometry_query_input_port().Eval(context)
    pairs = query.ComputeSignedDistancePairwiseClosestPoints(0.05)
    assert min(pair.distance for pair in pairs) > CLEARANCE_M - 1e-4
