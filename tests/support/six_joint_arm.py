"""An arm of one's own without any Python: six joints, one YAML file and a model without shapes.

The model has neither actuators nor collision shapes; the robot file gives gains and capsules.
"""

from pathlib import Path

# Link: length along its x, axis of its joint, stiffness, damping, home in degrees.
_LINKS = {
    "turret": (0.06, "0 0 1", 60.0, 12.0, 0.0),
    "upper_arm": (0.34, "0 1 0", 60.0, 12.0, -50.0),
    "forearm": (0.32, "0 1 0", 30.0, 5.0, 90.0),
    "roll": (0.06, "1 0 0", 15.0, 1.0, 0.0),
    "wrist": (0.08, "0 1 0", 15.0, 1.0, -40.0),
    "hand": (0.16, "1 0 0", 10.0, 0.5, 0.0),
}
_RADIUS = 0.03


def _model() -> str:
    parts, parent, origin = [], "column", "0 0 0.08"
    for name, (length, axis, *_) in _LINKS.items():
        parts.append(f"""
  <joint name="{name}_joint" type="revolute">
    <parent link="{parent}"/><child link="{name}"/><origin xyz="{origin}"/>
    <axis xyz="{axis}"/><limit lower="-2.5" upper="2.5" effort="100" velocity="5"/>
  </joint>
  <link name="{name}">
    <inertial>
      <origin xyz="{0.5 * length} 0 0"/><mass value="1.0"/>
      <inertia ixx="0.002" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/>
    </inertial>
  </link>""")
        parent, origin = name, f"{length} 0 0"
    return f'<robot name="six_joint_arm"><link name="column"/>{"".join(parts)}\n</robot>\n'


def _robot() -> str:
    joints = "\n".join(
        f"  {name}_joint: {{stiffness: {p}, damping: {d}, home_deg: {home}}}"
        for name, (_, _, p, d, home) in _LINKS.items()
    )
    capsules = "\n".join(
        f"  - {{link: {name}, ends: [[0.03, 0.0, 0.0], [{length - _RADIUS:.2f}, 0.0, 0.0]],"
        f" radius_m: {_RADIUS}}}"
        for name, (length, *_) in _LINKS.items()
        if name != "turret"
    )
    return f"""model: arm.urdf
base: {{frame: column, xyz: [0.0, -0.2, 0.7]}}
tip: {{frame: hand, xyz: [{_LINKS["hand"][0]}, 0.0, 0.0]}}
skin_links: all
capsules:
{capsules}
joints:
{joints}
carriage: add
height_range_m: [0.0, 0.4]
ignored_contacts: [[forearm, wrist], [roll, hand]]
"""


def write(folder: Path, old: str = "", new: str = "", model: tuple[str, str] = ("", "")) -> Path:
    """Writes robot file and model, each with one text replaced by another; returns its path."""
    assert old in _robot() and model[0] in _model()
    (folder / "arm.urdf").write_text(_model().replace(*model) if model[0] else _model())
    path = folder / "six-joint-arm.yaml"
    path.write_text(_robot().replace(old, new) if old else _robot())
    return path
