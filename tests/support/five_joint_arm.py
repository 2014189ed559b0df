"""An arm of one's own: five joints in space, described here from scratch, one call to register it.

It stands on a column in front of the clutter; its skin is a capsule on each link but the column's.
Set LIC_EXTENSIONS=support.five_joint_arm, or import this module, and it is a robot like the others.
"""

from functools import cache

from lic_drake.robots.arm import Arm
from lic_drake.robots.registry import register_robot

NAME = "five-joint-arm"

# Link: length along its x, axis of its joint, limits in radians, stiffness, damping.
_LINKS = {
    "turret": (0.05, "0 0 1", (-2.0, 2.0), 60.0, 8.0),
    "upper_arm": (0.32, "0 1 0", (-1.2, 1.4), 60.0, 8.0),
    "forearm": (0.30, "0 1 0", (-2.3, 2.3), 25.0, 3.0),
    "wrist": (0.08, "0 1 0", (-2.0, 2.0), 15.0, 1.5),
    "hand": (0.12, "0 0 1", (-1.8, 1.8), 15.0, 1.5),
}
_RADIUS = 0.025


def _link(name: str, length: float) -> str:
    skin = (
        ""
        if name == "turret"
        else f"""
    <collision name="{name}_skin">
      <origin xyz="{0.5 * length} 0 0" rpy="0 1.5707963267948966 0"/>
      <geometry><drake:capsule radius="{_RADIUS}" length="{length - 0.05:g}"/></geometry>
    </collision>"""
    )
    return f"""
  <link name="{name}">
    <inertial>
      <origin xyz="{0.5 * length} 0 0"/><mass value="1.0"/>
      <inertia ixx="0.001" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/>
    </inertial>{skin}
  </link>"""


def describe() -> str:
    """Returns the model as URDF."""
    parts, parent, offset = [], "base", 0.0
    for name, (length, axis, (low, high), p, d) in _LINKS.items():
        parts.append(f"""
  <joint name="{name}_joint" type="revolute">
    <parent link="{parent}"/><child link="{name}"/><origin xyz="{offset} 0 0"/>
    <axis xyz="{axis}"/><limit lower="{low}" upper="{high}" effort="200" velocity="10"/>
  </joint>{_link(name, length)}
  <transmission type="transmission_interface/SimpleTransmission">
    <joint name="{name}_joint"/>
    <actuator name="{name}_joint"><drake:controller_gains p="{p}" d="{d}"/></actuator>
  </transmission>""")
        parent, offset = name, length
    return f"""<robot name="five_joint_arm" xmlns:drake="http://drake.mit.edu">
  <link name="base"/>{"".join(parts)}
  <link name="tip"/>
  <joint name="tip_joint" type="fixed">
    <parent link="hand"/><child link="tip"/><origin xyz="{offset} 0 0"/>
  </joint>
</robot>"""


@cache
def five_joint_arm() -> Arm:
    """Returns the arm, read once a process."""
    return Arm(NAME, describe())


register_robot(NAME, five_joint_arm)
