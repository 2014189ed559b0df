import numpy as np
import pytest
from pydrake.geometry import SceneGraph
from pydrake.math import RotationMatrix
from pydrake.multibody.plant import MultibodyPlant

from lic_drake.errors import ScenarioError
from lic_drake.robots.pr2_description import LEFT_ARM_AT_REST, SOFT_LIMITS, joint_names
from lic_drake.robots.pr2_head import (
    HEAD_CAMERA,
    HEAD_TILT_RANGE_DEG,
    RIGHT_ARM_AT_REST,
    TILT_AXIS,
    LookingPr2,
)


def camera_pose(robot: LookingPr2) -> tuple[np.ndarray, np.ndarray, MultibodyPlant]:
    plant, scene_graph = MultibodyPlant(time_step=1e-3), SceneGraph()
    plant.RegisterAsSourceForSceneGraph(scene_graph)
    robot.add_to_plant(plant)
    plant.Finalize()
    X_WC = plant.GetFrameByName(HEAD_CAMERA).CalcPoseInWorld(plant.CreateDefaultContext())
    return X_WC.rotation().matrix(), X_WC.translation(), plant


def test_a_level_head_looks_along_x_with_the_image_upright() -> None:
    R_WC, p_WC, _ = camera_pose(LookingPr2((0.0, 0.0, 0.0), 0.1, 0.0))
    np.testing.assert_allclose(R_WC, [[0, 0, 1], [-1, 0, 0], [0, -1, 0]], atol=1e-12)
    # torso_lift_link is 0.05 m behind base_footprint, 0.790675 m and the lift above it.
    np.testing.assert_allclose(p_WC, [0.128 - 0.05, 0.0, 0.478 + 0.790675 + 0.1], atol=1e-9)


@pytest.mark.parametrize("tilt_deg", [-15.0, 18.0, 60.0])
def test_a_tilted_head_turns_its_camera_about_the_tilt_axis(tilt_deg: float) -> None:
    pose, torso_m = (0.4, -0.3, 0.7), 0.2
    R_level, p_level, _ = camera_pose(LookingPr2(pose, torso_m, 0.0))
    R_WC, p_WC, plant = camera_pose(LookingPr2(pose, torso_m, tilt_deg))
    yaw = RotationMatrix.MakeZRotation(pose[2]).matrix()
    p_WA = np.array([*pose[:2], 0.0]) + yaw @ ([-0.05, 0.0, 0.790675 + torso_m] + TILT_AXIS)
    turn = yaw @ RotationMatrix.MakeYRotation(np.deg2rad(tilt_deg)).matrix() @ yaw.T
    np.testing.assert_allclose(R_WC, turn @ R_level, atol=1e-9)
    np.testing.assert_allclose(p_WC, p_WA + turn @ (p_level - p_WA), atol=1e-9)
    # Down is positive, and nothing else of the robot moves.
    assert R_WC[2, 2] == pytest.approx(-np.sin(np.deg2rad(tilt_deg)))
    assert plant.num_positions() == 7


def test_at_rest_the_arms_are_mirror_images_within_the_soft_limits() -> None:
    low, high = np.array(SOFT_LIMITS).T
    assert np.all(RIGHT_ARM_AT_REST >= low)
    assert np.all(RIGHT_ARM_AT_REST <= high)
    _, _, plant = camera_pose(LookingPr2((0.0, 0.0, 0.0), 0.0115, 0.0))
    context = plant.CreateDefaultContext()
    for name, angle in zip(joint_names("r"), RIGHT_ARM_AT_REST, strict=True):
        joint = plant.GetJointByName(name)
        plant.SetPositions(context, _one(plant, context, joint.position_start(), angle))
    hands = [plant.GetFrameByName(f"{s}_gripper_tool_frame") for s in "rl"]
    right, left = (np.array(hand.CalcPoseInWorld(context).translation()) for hand in hands)
    np.testing.assert_allclose(right, left * [1.0, -1.0, 1.0], atol=1e-9)
    assert len(LEFT_ARM_AT_REST) == len(RIGHT_ARM_AT_REST)


def _one(plant: MultibodyPlant, context: object, index: int, value: float) -> np.ndarray:
    q = plant.GetPositions(context)  # type: ignore[arg-type]
    q[index] = value
    return q


def test_a_head_does_not_look_further_down_than_it_can() -> None:
    for tilt_deg in (HEAD_TILT_RANGE_DEG[0] - 1.0, HEAD_TILT_RANGE_DEG[1] + 1.0):
        with pytest.raises(ScenarioError, match="head_tilt_deg must be from"):
            LookingPr2((0.0, 0.0, 0.0), 0.1, tilt_deg)
