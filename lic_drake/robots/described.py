"""Robots that one YAML file describes: the model, its frames, skin, impedance and carriage.

models/robots/iiwa14.yaml shows all keys. Frame R stands where the carriage puts it; the base frame
is fixed in it, and the hand points along Ex of the tip.
"""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from pydrake.multibody.parsing import PackageMap

from lic_drake.config import check_numbers, read_mapping, read_named, read_section
from lic_drake.errors import ScenarioError
from lic_drake.paths import robots_dir
from lic_drake.robots.arm import Arm
from lic_drake.robots.fitting import Fitting


@dataclass(kw_only=True)
class Placement:
    """A frame of the model, and where it is: the base in R, or the tip in the frame."""

    frame: str = ""
    xyz: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])
    rpy_deg: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])

    def __post_init__(self) -> None:
        check_numbers(self, vectors={"xyz": 3, "rpy_deg": 3})


@dataclass(kw_only=True)
class SkinCapsule:
    """A capsule of skin on a link, in place of the shapes that the model has there."""

    link: str = ""
    # Both ends of its axis in the link's frame, and its radius, metres.
    ends: list[list[float]] = field(default_factory=list)
    radius_m: float = 0.0


@dataclass(kw_only=True)
class JointSettings:
    """What the impedance controller does with a joint, radians but where said otherwise."""

    # Nm/rad and Nms/rad; None: as in the model.
    stiffness: float | None = None
    damping: float | None = None
    # Limits, where narrower than those of the model, and the home posture, degrees.
    lower_deg: float | None = None
    upper_deg: float | None = None
    home_deg: float = 0.0
    # Position in radians or metres of a joint that does not move, as a finger's.
    held: float | None = None


@dataclass(kw_only=True)
class RobotFile:
    """The content of a robot file."""

    # URDF or SDF file, relative to the robot file, or package://.
    model: str = ""
    base: Placement = field(default_factory=lambda: Placement(frame="base"))
    tip: Placement = field(default_factory=lambda: Placement(frame="tip"))
    # Links whose shapes are skin, proximal to distal; none: all that the joints move and have any.
    skin_links: list[str] = field(default_factory=list)
    capsules: list[SkinCapsule] = field(default_factory=list)
    joints: dict[str, JointSettings] = field(default_factory=dict)
    # The model's joints along x, y and z that carry it; none: a rail-mounted pedestal is added.
    carriage: list[str] = field(default_factory=list)
    # Lowest and highest position of R, metres.
    height_range_m: list[float] = field(default_factory=lambda: [0.0, 0.0])
    # Pairs of links that touch by their design, as neighbours but one do.
    ignored_contacts: list[list[str]] = field(default_factory=list)

    def __post_init__(self) -> None:
        check_numbers(self, intervals=["height_range_m"])
        if len(self.carriage) not in (0, 3):
            raise ScenarioError(
                f"carriage must be add, or the joints along x, y and z, got {self.carriage}"
            )
        for capsule in self.capsules:
            if [len(end) for end in capsule.ends] != [3, 3] or not capsule.radius_m > 0.0:
                raise ScenarioError(
                    f"capsules: that of {capsule.link!r} needs ends: [[x, y, z], [x, y, z]] and a"
                    f" positive radius_m, got {capsule.ends} and {capsule.radius_m}"
                )
        for pair in self.ignored_contacts:
            if len(pair) != 2:
                raise ScenarioError(f"ignored_contacts must be pairs of links, got {pair}")
        for name, joint in self.joints.items():
            gains = (joint.stiffness, joint.damping)
            if gains != (None, None) and not all(gain and gain > 0.0 for gain in gains):
                raise ScenarioError(
                    f"joints: {name}: needs a positive stiffness, Nm/rad, and damping, Nms/rad, got"
                    f" {joint.stiffness} and {joint.damping}"
                )


def described_robot(name: str | Path) -> Arm:
    """Returns the arm of a robot file, or of a shipped one by its name; a ScenarioError if none."""
    content = read_named(name, robots_dir(), "robot")
    path = Path(name) if Path(name).suffix else robots_dir() / f"{name}.yaml"
    return _read(content, path)


def robot_path(name: str, beside: str | Path) -> str:
    """Returns the absolute path of a robot file that another file names; other names as they are.

    It is sought beside that file, then in the working directory.
    """
    if Path(name).suffix not in (".yaml", ".yml"):
        return name
    path = Path(beside).parent / name
    return str((path if path.is_file() else Path(name)).resolve())


@lru_cache(maxsize=64)
def _read(content: bytes, path: Path) -> Arm:
    source = str(path)
    data = read_mapping(content, source)
    for key, none in (("skin_links", "all"), ("carriage", "add")):
        if data.get(key) == none:
            data[key] = []
    known = [item.name for item in fields(RobotFile)]
    for key in data:
        if key not in known:
            raise ScenarioError(f"{source}: unknown key {key!r}; known: {', '.join(known)}")
    robot = read_section(RobotFile, data, source)
    model = _find_model(robot.model, path)
    shipped = path.parent == robots_dir()
    digest = hashlib.sha256(content + model.read_bytes()).hexdigest()[:12]
    try:
        return Arm(
            path.stem,
            model,
            base_frame=Fitting.BASE,
            tip_frame=Fitting.TIP,
            skin_links=robot.skin_links or None,
            held={name: j.held for name, j in robot.joints.items() if j.held is not None},
            carriage=_three(robot.carriage),
            height_range_m=(robot.height_range_m[0], robot.height_range_m[1]),
            home={name: float(np.deg2rad(j.home_deg)) for name, j in robot.joints.items()},
            digest=path.stem if shipped else f"{path.stem}-{digest}",
            fitting=_fitting(robot),
        )
    except ScenarioError as error:
        raise ScenarioError(f"{source}: {error}") from None


def _find_model(model: str, path: Path) -> Path:
    """Returns the path of the model of a robot file."""
    if not model:
        raise ScenarioError(f"{path}: model must be a URDF or SDF file, or package://, got ''")
    try:
        url = model.startswith("package://")
        found = Path(PackageMap().ResolveUrl(model)) if url else path.parent / model
    except RuntimeError as error:
        reason = " ".join(str(error).split())[:200]
        raise ScenarioError(f"{path}: model: cannot find {model}: {reason}") from None
    if not found.is_file() or found.suffix not in (".urdf", ".sdf"):
        raise ScenarioError(
            f"{path}: model: {found} is no URDF or SDF file; give its path relative to {path.name}"
        )
    return found


def _fitting(robot: RobotFile) -> Fitting:
    """Returns what is to be changed in the model."""
    return Fitting(
        base=(robot.base.frame, robot.base.xyz, robot.base.rpy_deg),
        tip=(robot.tip.frame, robot.tip.xyz, robot.tip.rpy_deg),
        capsules=[(c.link, c.ends, c.radius_m) for c in robot.capsules],
        gains={
            name: (joint.stiffness, joint.damping)
            for name, joint in robot.joints.items()
            if joint.stiffness is not None and joint.damping is not None
        },
        limits_deg={name: (j.lower_deg, j.upper_deg) for name, j in robot.joints.items()},
        ignored_contacts=robot.ignored_contacts,
        pedestal_m=0.0 if robot.carriage else robot.base.xyz[2] + robot.height_range_m[1],
    )


def _three(names: Sequence[str]) -> Any:
    return tuple(names) or None
