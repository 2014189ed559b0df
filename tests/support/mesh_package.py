"""A small package://drake_models: the PR2's links, some with a box of a mesh; no network."""

import itertools
from pathlib import Path

import numpy as np
import pytest

PALM_EXTENT = 0.03
"""Half the edge of the palm's mesh before it is scaled, metres."""

# As in Drake's: the palm hangs on the wrist, the head on two joints, an arm on its roll link.
LINKS = {
    "base_footprint": "",
    "base_link": "base",
    "torso_lift_link": "torso",
    "head_pan_link": "head",
    "head_tilt_link": "head",
    "r_shoulder_pan_link": "",
    "r_upper_arm_roll_link": "",
    "r_upper_arm_link": "arm",
    "r_gripper_palm_link": "palm",
}
JOINTS = [
    ("base_footprint", "base_link", "fixed", "0 0 0.051"),
    ("base_link", "torso_lift_link", "prismatic", "-0.05 0 0.739675"),
    ("torso_lift_link", "head_pan_link", "revolute", "-0.01707 0 0.38145"),
    ("head_pan_link", "head_tilt_link", "revolute", "0.068 0 0"),
    ("torso_lift_link", "r_shoulder_pan_link", "revolute", "0 -0.188 0"),
    ("r_shoulder_pan_link", "r_upper_arm_roll_link", "revolute", "0.1 0 0"),
    ("r_upper_arm_roll_link", "r_upper_arm_link", "fixed", "0 0 0"),
    ("r_upper_arm_link", "r_gripper_palm_link", "fixed", "0.721 0 0"),
]


def write_drake_models(folder: Path) -> Path:
    """Writes the package; returns its folder."""
    package = folder / "drake_models"
    meshes = package / "pr2_description" / "meshes"
    meshes.mkdir(parents=True)
    (package / "package.xml").write_text("<package><name>drake_models</name></package>")
    for name, extent in (("base", 0.3), ("torso", 0.2), ("head", 0.1), ("arm", 0.05)):
        _write_box(meshes / f"{name}.obj", extent)
    _write_box(meshes / "palm.obj", PALM_EXTENT)
    urdf = package / "pr2_description" / "urdf" / "pr2_simplified.urdf"
    urdf.parent.mkdir()
    links = "".join(_link(name, mesh) for name, mesh in LINKS.items())
    joints = "".join(
        f'<joint name="{child}_joint" type="{kind}"><parent link="{parent}"/>'
        f'<child link="{child}"/><origin xyz="{xyz}"/><axis xyz="0 0 1"/>'
        '<limit lower="-1" upper="1" effort="1" velocity="1"/></joint>'
        for parent, child, kind, xyz in JOINTS
    )
    urdf.write_text(f'<robot name="pr2">{links}{joints}</robot>')
    return package


def go_offline(monkeypatch: pytest.MonkeyPatch, folder: Path) -> None:
    """Leaves Drake an empty cache in a folder, no packages, and a proxy that is not there."""
    for name in ("ROS_PACKAGE_PATH", "TEST_TMPDIR", "DRAKE_ALLOW_NETWORK", "NO_PROXY", "no_proxy"):
        monkeypatch.delenv(name, raising=False)
    for name in ("http_proxy", "https_proxy", "HTTP_PROXY", "HTTPS_PROXY"):
        monkeypatch.setenv(name, "http://127.0.0.1:9")
    (folder / "cache").mkdir()
    monkeypatch.setenv("XDG_CACHE_HOME", str(folder / "cache"))


def _link(name: str, mesh: str) -> str:
    file = f"package://drake_models/pr2_description/meshes/{mesh}.obj"
    scale = ' scale="2 2 2"' if mesh == "palm" else ""
    seen = f'<origin xyz="0 0 0.01"/><geometry><mesh filename="{file}"{scale}/></geometry>'
    if mesh == "base":
        seen += '<material name="blue"><color rgba="0.2 0.4 0.6 1"/></material>'
    hit = f'<geometry><mesh filename="{file}"/></geometry>'
    if not mesh:
        seen = hit = '<geometry><box size="1 1 1"/></geometry>'
    return f'<link name="{name}"><visual>{seen}</visual><collision>{hit}</collision></link>'


def _write_box(path: Path, extent: float) -> None:
    corners = extent * np.array(list(itertools.product((-1, 1), repeat=3)))
    faces = {"-1 0 0": "1243", "1 0 0": "5786", "0 -1 0": "1562", "0 1 0": "3487"}
    faces |= {"0 0 -1": "1375", "0 0 1": "2684"}
    lines = ["v {} {} {}".format(*corner) for corner in corners]
    lines += [f"vn {normal}" for normal in faces]
    for k, face in enumerate(faces.values(), start=1):
        lines.append("f " + " ".join(f"{corner}//{k}" for corner in face))
    path.write_text("\n".join(lines) + "\n")
