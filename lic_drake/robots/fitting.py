"""`Fitting`: what a robot file changes in a model before it becomes an arm."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import ClassVar
from xml.etree import ElementTree

import numpy as np
from pydrake.geometry import Capsule, Cylinder, Sphere
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix
from pydrake.multibody.plant import CoulombFriction, MultibodyPlant
from pydrake.multibody.tree import (
    FixedOffsetFrame,
    Joint,
    ModelInstanceIndex,
    PdControllerGains,
)

from lic_drake.errors import ScenarioError
from lic_drake.types import Vector

_DRAKE = "{http://drake.mit.edu}"
_SKIN_COLOR = np.array([0.66, 0.67, 0.69, 1.0])
_PEDESTAL_COLOR = np.array([0.35, 0.35, 0.38, 1.0])
_PEDESTAL_RADIUS_M = 0.09

type Place = tuple[str, Sequence[float], Sequence[float]]
"""A frame, and xyz, metres, and roll, pitch and yaw, degrees."""


@dataclass(frozen=True, kw_only=True)
class Fitting:
    """What is added to a parsed model.

    Attributes:
        base: The frame that stands still, and where it is in R.
        tip: The frame of the hand, and where E is in it.
        capsules: Link, ends of the axis in the link's frame and radius, metres.
        gains: Stiffness, Nm/rad, and damping, Nms/rad, by joint.
        limits_deg: Lower and upper limits, degrees, None as in the model, by joint.
        ignored_contacts: Pairs of links that may touch.
        pedestal_m: Length of the column under the base, metres; 0: none.
    """

    BASE: ClassVar[str] = "fitted_base"
    TIP: ClassVar[str] = "fitted_tip"

    base: Place
    tip: Place
    capsules: Sequence[tuple[str, Sequence[Sequence[float]], float]]
    gains: Mapping[str, tuple[float, float]]
    limits_deg: Mapping[str, tuple[float | None, float | None]]
    ignored_contacts: Sequence[Sequence[str]]
    pedestal_m: float

    def read_model(self, path: Path) -> Path | str:
        """Returns the model, as text where its shapes or what they may touch are changed.

        Raises:
            ScenarioError: It is not XML, or has no such link.
        """
        links = {link for link, _, _ in self.capsules}
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

    def apply(self, plant: MultibodyPlant, arm: ModelInstanceIndex) -> None:
        """Changes a parsed model; a ScenarioError names the key whose value does not fit."""
        self._add_frames(plant, arm)
        self._set_gains(plant, arm)
        for name, limits in self.limits_deg.items():
            joint = _joint(plant, arm, name)
            low, high = joint.position_lower_limits(), joint.position_upper_limits()
            if limits[0] is not None:
                low = np.maximum(low, math.radians(limits[0]))
            if limits[1] is not None:
                high = np.minimum(high, math.radians(limits[1]))
            if np.any(low > high):
                raise ScenarioError(f"joints: {name}: no position is within limits of {limits}")
            joint.set_position_limits(low, high)
        if plant.geometry_source_is_registered():
            self._add_shapes(plant, arm)

    def _add_frames(self, plant: MultibodyPlant, arm: ModelInstanceIndex) -> None:
        for key, name, (frame, xyz, rpy_deg) in (
            ("base", self.BASE, self.base),
            ("tip", self.TIP, self.tip),
        ):
            if not plant.HasFrameNamed(frame, arm):
                frames = [plant.get_frame(i).name() for i in plant.GetFrameIndices(arm)]
                raise ScenarioError(
                    f"{key}: frame {frame!r} is not in the model; it has"
                    f" {', '.join(filter(None, frames))}"
                )
            X = RigidTransform(RollPitchYaw(np.deg2rad(rpy_deg)), np.array(xyz))
            X = X.inverse() if key == "base" else X
            plant.AddFrame(FixedOffsetFrame(name, plant.GetFrameByName(frame, arm), X, arm))

    def _set_gains(self, plant: MultibodyPlant, arm: ModelInstanceIndex) -> None:
        """Adds an actuator to each joint with gains, from the base to the tip.

        In that order the plant takes the desired state, whatever the model's order is.
        """
        every = map(plant.get_joint_actuator, plant.GetJointActuatorIndices())
        old = {a.joint().name(): a for a in every if a.model_instance() == arm}
        for joint in sorted((_joint(plant, arm, name) for name in self.gains), key=_depth(plant)):
            name, effort, rotor, gear = joint.name(), np.inf, 0.0, 1.0
            if name in old:
                effort, gear = old[name].effort_limit(), old[name].default_gear_ratio()
                rotor = old[name].default_rotor_inertia()
                plant.RemoveJointActuator(old[name])
            actuator = plant.AddJointActuator(name, joint, effort)
            actuator.set_default_rotor_inertia(rotor)
            actuator.set_default_gear_ratio(gear)
            stiffness, damping = self.gains[name]
            actuator.set_controller_gains(PdControllerGains(p=stiffness, d=damping))

    def _add_shapes(self, plant: MultibodyPlant, arm: ModelInstanceIndex) -> None:
        """Adds the skin and the pedestal; the scene gives the skin its contact properties."""
        friction = CoulombFriction(0.0, 0.0)
        for i, (link, ends, radius) in enumerate(self.capsules):
            body = plant.GetBodyByName(link, arm)
            first, last = np.array(ends)
            X_LS, length = _along(last - first), math.dist(first, last)
            shape = Capsule(radius, length) if length > 0.0 else Sphere(radius)
            X_LS.set_translation(0.5 * (first + last))
            name = f"{link}_skin{i}"
            plant.RegisterCollisionGeometry(body, X_LS, shape, name, friction)
            plant.RegisterVisualGeometry(body, X_LS, shape, name, _SKIN_COLOR)
        if self.pedestal_m > 0.0:
            frame = plant.GetFrameByName(self.base[0], arm)
            X_BP = RigidTransform(np.array([0.0, 0.0, -0.5 * self.pedestal_m]))
            column = Cylinder(_PEDESTAL_RADIUS_M, self.pedestal_m)
            X_LP = frame.GetFixedPoseInBodyFrame() @ X_BP
            body = frame.body()
            plant.RegisterCollisionGeometry(body, X_LP, column, "pedestal", friction)
            plant.RegisterVisualGeometry(body, X_LP, column, "pedestal", _PEDESTAL_COLOR)


def _depth(plant: MultibodyPlant) -> Callable[[Joint], int]:
    """Returns how many joints are between the base and a joint."""
    joints = [plant.get_joint(index) for index in plant.GetJointIndices()]
    above = {joint.child_body().index(): joint for joint in joints}

    def depth(joint: Joint) -> int:
        parent = above.get(joint.parent_body().index())
        return 0 if parent is None else 1 + depth(parent)

    return depth


def _joint(plant: MultibodyPlant, arm: ModelInstanceIndex, name: str) -> Joint:
    """Returns a joint; a ScenarioError if there is none."""
    if not plant.HasJointNamed(name, arm):
        joints = [plant.get_joint(i) for i in plant.GetJointIndices(arm)]
        moving = [joint.name() for joint in joints if joint.num_positions()]
        raise ScenarioError(f"joints: {name!r} is not in the model; it has {', '.join(moving)}")
    return plant.GetJointByName(name, arm)


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
