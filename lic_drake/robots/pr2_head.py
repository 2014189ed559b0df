"""A PR2 that looks: its head tilted, its right arm beside the body."""

from collections.abc import Sequence

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import Frame, ModelInstanceIndex

from lic_drake.errors import ScenarioError
from lic_drake.robots.pr2 import Pr2Arm
from lic_drake.robots.pr2_description import LEFT_ARM_AT_REST

HEAD_CAMERA = "head_camera"
"""Frame of the head's camera in models/pr2/pr2.urdf."""

HEAD_TILT_RANGE_DEG = (-21.27, 74.27)
"""Soft limits of the head's tilt, down positive (PR2/pr2_common, head.urdf.xacro, BSD)."""

TILT_AXIS = np.array([0.05093, 0.0, 0.38145])
"""A point of the tilt axis, along y, in torso_lift_link, metres (same source)."""

RIGHT_ARM_AT_REST = np.array(LEFT_ARM_AT_REST) * [-1.0, 1.0, -1.0, 1.0, -1.0, 1.0, 1.0]
"""The left arm's posture mirrored: beside the body, not before the camera, radians."""


class LookingPr2(Pr2Arm):
    """The robot before it reaches.

    Args:
        base_pose: Where the base stands in R: x, y (metres) and heading (radians).
        torso_m: Height of the torso lift, metres.
        head_tilt_deg: How far the head looks down, degrees.

    Raises:
        ScenarioError: Torso or head cannot go there.
    """

    def __init__(
        self,
        base_pose: Sequence[float],
        torso_m: float,
        head_tilt_deg: float,
    ) -> None:
        super().__init__(base_pose, torso_m)
        low, high = HEAD_TILT_RANGE_DEG
        if not low <= head_tilt_deg <= high:
            raise ScenarioError(
                f"the PR2's head_tilt_deg must be from {low} to {high}, got {head_tilt_deg}"
            )
        self.head_tilt_deg = head_tilt_deg

    def add_to_plant(
        self, plant: MultibodyPlant, parent: Frame | None = None
    ) -> ModelInstanceIndex:
        """Adds the robot as `Pr2Arm` does, and tilts its head."""
        pr2 = super().add_to_plant(plant, parent)
        level = plant.GetJointByName("head_joint", pr2)
        torso, head = level.frame_on_parent(), level.frame_on_child()
        plant.RemoveJoint(level)
        # In the model the head's frame is the torso's.
        to_axis = RigidTransform(TILT_AXIS)
        turn = RigidTransform(RotationMatrix.MakeYRotation(np.deg2rad(self.head_tilt_deg)))
        plant.WeldFrames(torso, head, to_axis @ turn @ to_axis.inverse())
        return pr2
