"""Robots that one YAML file describes: the model, its frames, skin, impedance and carriage.

models/robots/iiwa14.yaml shows all keys. Frame R stands where the carriage puts it; the base frame
is fixed in it, and the hand points along Ex of the tip.
"""

import hashlib
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass, field
from functools import lru_cache
from itertools import chain
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from pydrake.geometry import Capsule, Cylinder, Sphere
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix
from pydrake.multibody.parsing import PackageMap
from pydrake.multibody.plant import CoulombFriction, MultibodyPlant
from pydrake.multibody.tree import (
    FixedOffsetFrame,
    Joint,
    ModelInstanceIndex,
    PdControllerGains,
    PrismaticJoint,
)

from lic_drake.config import check_numbers, read_mapping, read_named, read_section
from lic_drake.errors import ScenarioError
from lic_drake.paths import robots_dir
from lic_drake.robots.arm import Arm
from lic_drake.types import Vector

_BASE, _TIP = "fitted_base", "fitted_tip"
_DRAKE = "{http://drake.mit.edu}"
_SKIN_COLOR = np.array([0.66, 0.67, 0.69, 1.0])
_PEDESTAL_COLOR = np.array([0.35, 0.35, 0.38, 1.0])
_PEDESTAL_RADIUS_M = 0.09


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
    # Values of the controller that suit the gains; those of a scenario come first.
    mpc: dict[str, float] = field(default_factory=dict)
    # Pairs of links that touch by their design, as neighbours but one do.
    ignored_contacts: list[list[str]] = field(default_factory=list)

    def __post_init__(self) -> None:
        check_numbers(self, finite=["height_range_m"], intervals=["height_range_m"])
        if len(self.carriage) not in (0, 3):
            raise ScenarioError(
                f"carriage must be add, or the joints along x, y and z, got {self.carriage}"
            )
        for capsule in self.capsules:
            sizes, numbers = list(map(len, capsule.ends)), [*chain(*capsule.ends), capsule.radius_m]
            if sizes != [3, 3] or not _finite(numbers) or not capsule.radius_m > 0.0:
                raise ScenarioError(
                    f"capsules: that of {capsule.link!r} needs ends: [[x, y, z], [x, y, z]] and a"
                    f" positive radius_m, got {capsule.ends} and {capsule.radius_m}"
                )
        for pair in self.ignored_contacts:
            if len(pair) != 2:
                raise ScenarioError(f"ignored_contacts must be pairs of links, got {pair}")
        for name, joint in self.joints.items():
            for key, value in vars(joint).items():
                if value is not None and not math.isfinite(value):
                    raise ScenarioError(f"joints: {name}: {key} must be finite, got {value}")
            gains = (joint.stiffness, joint.damping)
            if gains != (None, None) and not all(gain and gain > 0.0 for gain in gains):
                raise ScenarioError(
                    f"joints: {name}: needs a positive stiffness, Nm/rad, and damping, Nms/rad, got"
                    f" {joint.stiffness} and {joint.damping}"
                )

    def read_model(self, path: Path) -> Path | str:
        """Returns the model, as text where its shapes or what they may touch are changed.

        Raises:
            ScenarioError: It is not XML, or has no such link.
        """
        links = {capsule.link for capsule in self.capsules}
        if not links and not self.ignored_contacts:
            return path
        try:
            root = ElementTree.parse(path).getroot()
        except ElementTree.ParseError as error:
            raise ScenarioError(f"model: {path} is not XML: {error}") from None
        names = [link.get("name", "") for link in root.iter("link")]
        _check_links(links, names, "capsules")
        _check_links(chain(*self.ignored_contacts), names, "ignored_contacts")
        ElementTree.register_namespace("drake", _DRAKE[1:-1])
        for link in root.iter("link"):
            for shape in link.findall("collision") if link.get("name") in links else ():
                link.remove(shape)
        model = root.find("model")
        for i, pair in enumerate(self.ignored_contacts):
            (root if model is None else model).append(_ignored(f"ignored{i}", pair))
        # Text has no folder: what it names must not be relative.
        for part in root.iter():
            name = part.get("filename")
            if name is not None:
                part.set("filename", _absolute(name, path.parent))
            if part.tag == "uri" and part.text:
                part.text = _absolute(part.text.strip(), path.parent)
        return ElementTree.tostring(root, encoding="unicode")

    def fit(self, plant: MultibodyPlant, arm: ModelInstanceIndex) -> None:
        """Changes a parsed model; a ScenarioError names the key whose value does not fit."""
        self._add_frames(plant, arm)
        self._set_gains(plant, arm)
        for name, given in self.joints.items():
            joint = _joint(plant, arm, name)
            low, high = joint.position_lower_limits(), joint.position_upper_limits()
            if given.lower_deg is not None:
                low = np.maximum(low, math.radians(given.lower_deg))
            if given.upper_deg is not None:
                high = np.minimum(high, math.radians(given.upper_deg))
            if np.any(low > high):
                raise ScenarioError(
                    f"joints: {name}: no position is within limits of {given.lower_deg} and"
                    f" {given.upper_deg} degrees and of the model"
                )
            joint.set_position_limits(low, high)
            if given.held is not None and not np.all((low <= given.held) & (given.held <= high)):
                raise ScenarioError(
                    f"joints: {name}: held must be within its limits, from {low.min():g} to"
                    f" {high.max():g}, got {given.held:g}"
                )
        for name in self.carriage:
            if not isinstance(_joint(plant, arm, name, "carriage"), PrismaticJoint):
                raise ScenarioError(f"carriage: joint {name!r} turns; name one that slides, or add")
        if plant.geometry_source_is_registered():
            self._add_shapes(plant, arm)

    def _add_frames(self, plant: MultibodyPlant, arm: ModelInstanceIndex) -> None:
        for key, name, place in (("base", _BASE, self.base), ("tip", _TIP, self.tip)):
            if not plant.HasFrameNamed(place.frame, arm):
                frames = [plant.get_frame(i).name() for i in plant.GetFrameIndices(arm)]
                raise ScenarioError(
                    f"{key}: frame {place.frame!r} is not in the model; it has"
                    f" {', '.join(filter(None, frames))}"
                )
            X = RigidTransform(RollPitchYaw(np.deg2rad(place.rpy_deg)), np.array(place.xyz))
            X = X.inverse() if key == "base" else X
            plant.AddFrame(FixedOffsetFrame(name, plant.GetFrameByName(place.frame, arm), X, arm))

    def _set_gains(self, plant: MultibodyPlant, arm: ModelInstanceIndex) -> None:
        """Adds an actuator to each joint with gains, from the base to the tip.

        In that order the plant takes the desired state, whatever the model's order is.
        """
        every = map(plant.get_joint_actuator, plant.GetJointActuatorIndices())
        old = {a.joint().name(): a for a in every if a.model_instance() == arm}
        given = [name for name, joint in self.joints.items() if joint.stiffness is not None]
        for joint in sorted((_joint(plant, arm, name) for name in given), key=_depth(plant)):
            name, effort, rotor, gear = joint.name(), np.inf, 0.0, 1.0
            if name in old:
                effort, gear = old[name].effort_limit(), old[name].default_gear_ratio()
                rotor = old[name].default_rotor_inertia()
                plant.RemoveJointActuator(old[name])
            actuator = plant.AddJointActuator(name, joint, effort)
            actuator.set_default_rotor_inertia(rotor)
            actuator.set_default_gear_ratio(gear)
            gains = self.joints[name]
            actuator.set_controller_gains(PdControllerGains(p=gains.stiffness, d=gains.damping))

    def _add_shapes(self, plant: MultibodyPlant, arm: ModelInstanceIndex) -> None:
        """Adds the skin and the pedestal; the scene gives the skin its contact properties."""
        friction = CoulombFriction(0.0, 0.0)
        for i, capsule in enumerate(self.capsules):
            body, radius = plant.GetBodyByName(capsule.link, arm), capsule.radius_m
            first, last = np.array(capsule.ends)
            X_LS, length = _along(last - first), math.dist(first, last)
            shape = Capsule(radius, length) if length > 0.0 else Sphere(radius)
            X_LS.set_translation(0.5 * (first + last))
            name = f"{capsule.link}_skin{i}"
            plant.RegisterCollisionGeometry(body, X_LS, shape, name, friction)
            plant.RegisterVisualGeometry(body, X_LS, shape, name, _SKIN_COLOR)
        # What the base stands on, down to the floor when it is highest.
        pedestal_m = 0.0 if self.carriage else self.base.xyz[2] + self.height_range_m[1]
        if pedestal_m > 0.0:
            frame = plant.GetFrameByName(self.base.frame, arm)
            # Upright, however the arm is mounted on it.
            R_BR = RollPitchYaw(np.deg2rad(self.base.rpy_deg)).ToRotationMatrix().inverse()
            X_BP = RigidTransform(R_BR, R_BR @ np.array([0.0, 0.0, -0.5 * pedestal_m]))
            column = Cylinder(_PEDESTAL_RADIUS_M, pedestal_m)
            X_LP = frame.GetFixedPoseInBodyFrame() @ X_BP
            body = frame.body()
            plant.RegisterCollisionGeometry(body, X_LP, column, "pedestal", friction)
            plant.RegisterVisualGeometry(body, X_LP, column, "pedestal", _PEDESTAL_COLOR)


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
        elif isinstance(data.get(key), str):  # It would be read letter by letter.
            raise ScenarioError(f"{source}: {key} must be {none} or a list, got {data[key]!r}")
    robot = read_section(RobotFile, data, source)
    model = _find_model(robot.model, path)
    identity = repr(asdict(robot)).encode() + model.read_bytes()
    try:
        return Arm(
            path.stem,
            robot.read_model(model),
            base_frame=_BASE,
            tip_frame=_TIP,
            skin_links=robot.skin_links or None,
            held={name: j.held for name, j in robot.joints.items() if j.held is not None},
            carriage=robot.carriage or None,
            height_range_m=(robot.height_range_m[0], robot.height_range_m[1]),
            home={name: math.radians(j.home_deg) for name, j in robot.joints.items()},
            digest=f"{path.stem}-{hashlib.sha256(identity).hexdigest()[:12]}",
            mpc=robot.mpc,
            fit=robot.fit,
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


def _depth(plant: MultibodyPlant) -> Callable[[Joint], int]:
    """Returns how many joints are between the base and a joint."""
    joints = [plant.get_joint(index) for index in plant.GetJointIndices()]
    above = {joint.child_body().index(): joint for joint in joints}

    def depth(joint: Joint) -> int:
        parent = above.get(joint.parent_body().index())
        return 0 if parent is None else 1 + depth(parent)

    return depth


def _joint(plant: MultibodyPlant, arm: ModelInstanceIndex, name: str, key: str = "joints") -> Joint:
    """Returns a joint; a ScenarioError if there is none."""
    if not plant.HasJointNamed(name, arm):
        joints = [plant.get_joint(i) for i in plant.GetJointIndices(arm)]
        moving = [joint.name() for joint in joints if joint.num_positions()]
        raise ScenarioError(f"{key}: {name!r} is not in the model; it has {', '.join(moving)}")
    return plant.GetJointByName(name, arm)


def _finite(numbers: Iterable[float]) -> bool:
    return all(map(math.isfinite, numbers))


def _check_links(names: Iterable[str], known: Iterable[str], key: str) -> None:
    for name in names:
        if name not in known:
            links = ", ".join(known)
            raise ScenarioError(f"{key}: link {name!r} is not in the model; it has {links}")


def _along(axis: Vector) -> RigidTransform:
    """Returns a rotation that lays Sz along an axis, which may be 0: then none."""
    if not np.any(axis):
        return RigidTransform()
    return RigidTransform(RotationMatrix.MakeFromOneVector(axis, 2), np.zeros(3))


def _ignored(name: str, links: Sequence[str]) -> ElementTree.Element:
    """Returns a group of links that may touch, in the words of URDF (attributes) and SDF (text)."""
    group = ElementTree.Element(f"{_DRAKE}collision_filter_group", name=name)
    for link in links:
        ElementTree.SubElement(group, f"{_DRAKE}member", link=link).text = link
    ignored = f"{_DRAKE}ignored_collision_filter_group"
    ElementTree.SubElement(group, ignored, name=name).text = name
    return group


def _absolute(name: str, folder: Path) -> str:
    return name if "://" in name else str((folder / name).resolve())
