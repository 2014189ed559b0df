"""The right arm of a PR2 whose base and torso stand still for the reach (paper IV-B, V)."""

from functools import cache
from xml.etree import ElementTree

import numpy as np

from lic_drake.errors import ScenarioError
from lic_drake.paths import models_dir
from lic_drake.robots.arm import Arm
from lic_drake.robots.kinematics import Kinematics
from lic_drake.robots.pr2_kinematics import Pr2Kinematics
from lic_drake.types import Vector

JOINTS = (
    *("shoulder_pan", "shoulder_lift", "upper_arm_roll", "elbow_flex"),
    *("forearm_roll", "wrist_flex", "wrist_roll"),
)
"""The joints of an arm, without side and suffix; each moves a link of its name."""

CARRIAGE = ("x", "y", "torso_lift_joint")
"""Joints of the base, whose heading is held, and of the torso lift."""

TORSO_RANGE_M = (0.0115, 0.305)
"""Soft limits of the torso lift, metres (PR2/pr2_common, commit e1f9029, BSD)."""

MPC_MIN_DEG = (-109.0, -24.0, -220.0, -132.0, -270.0, -120.0, -180.0)
"""Joint limits of the controller (gt-ros-pkg/hrl-haptic-manip, facts only), mirrored to the right.

They give the continuous joints an end, as cables do.
"""

MPC_MAX_DEG = (26.0, 68.0, 41.0, 0.0, 270.0, 0.0, 180.0)
"""Their upper ends."""

Q_HOME: Vector = np.deg2rad([-40.0, 20.0, -90.0, -90.0, 0.0, -45.0, 0.0])
"""A posture of ours: elbow out to the side, hand before the body, nothing near a limit, radians."""

LEFT_ARM_AT_REST = (1.8, 1.0, 1.2, -1.9, -0.5, -0.6, 0.0)
"""Where we hold the left arm, radians: beside the body, out of the right arm's way."""

RIGHT_ARM_AT_REST: Vector = np.array(LEFT_ARM_AT_REST) * [-1.0, 1.0, -1.0, 1.0, -1.0, 1.0, 1.0]
"""The same posture mirrored: beside the body, not before the camera, radians."""

HEAD_CAMERA = "head_camera"
"""Frame of the head's camera in models/pr2/pr2.urdf."""

HEAD_TILT_RANGE_DEG = (-21.27, 74.27)
"""Soft limits of the head's tilt, down positive (PR2/pr2_common, head.urdf.xacro, BSD)."""

TILT_AXIS = (0.05093, 0.0, 0.38145)
"""A point of the tilt axis, along y, in torso_lift_link, metres (same source)."""


def make_pr2(heading: float = 0.0, head_tilt_deg: float = 0.0) -> Arm:
    """Returns the right arm of a PR2 with a heading, radians, and its head tilted downwards."""
    low, high = HEAD_TILT_RANGE_DEG
    if not low <= head_tilt_deg <= high:
        raise ScenarioError(
            f"the PR2's head_tilt_deg must be from {low} to {high}, got {head_tilt_deg}"
        )
    left = (f"l_{joint}_joint" for joint in JOINTS)
    return Arm(
        "pr2",
        _tilt_head(head_tilt_deg),
        base_frame="base_link_for_rbt_compat",
        tip_frame="r_gripper_tool_frame",
        skin_links=[f"r_{joint}_link" for joint in JOINTS],
        q_min=np.deg2rad(MPC_MIN_DEG),
        q_max=np.deg2rad(MPC_MAX_DEG),
        held={"theta": heading} | dict(zip(left, LEFT_ARM_AT_REST, strict=True)),
        carriage=CARRIAGE,
        height_range_m=TORSO_RANGE_M,
        home={f"r_{joint}_joint": q for joint, q in zip(JOINTS, Q_HOME.tolist(), strict=True)},
        kinematics=Kinematics if heading else Pr2Kinematics,
    )


@cache
def pr2_arm() -> Arm:
    """Returns the arm of a PR2 that heads for the clutter, made once a process."""
    return make_pr2()


def _tilt_head(tilt_deg: float) -> str:
    """Returns the model with the head, whose frame is the torso's at zero, tilted."""
    robot = ElementTree.parse(models_dir() / "pr2" / "pr2.urdf").getroot()
    ElementTree.register_namespace("drake", "http://drake.mit.edu")
    tilt = np.deg2rad(tilt_deg)
    x, _, z = TILT_AXIS
    c, s = np.cos(tilt), np.sin(tilt)
    origin = robot.find("joint[@name='head_joint']/origin")
    assert origin is not None
    origin.set("xyz", f"{x - c * x - s * z} 0 {z + s * x - c * z}")
    origin.set("rpy", f"0 {tilt} 0")
    return ElementTree.tostring(robot, encoding="unicode")
