"""The meshes of Drake's public PR2, placed on the links of models/pr2/pr2.urdf."""

import logging
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import cast
from xml.etree import ElementTree

import numpy as np
from pydrake.geometry import GeometryProperties, Mesh, Rgba, Role, SceneGraph
from pydrake.math import RigidTransform
from pydrake.multibody.parsing import PackageMap, Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import BodyIndex, ModelInstanceIndex

from lic_drake.errors import ModelError
from lic_drake.robots.pr2_description import add_pr2
from lic_drake.show.drake_models import PACKAGE
from lic_drake.types import Vector

DESCRIPTION = Path("pr2_description", "urdf", "pr2_simplified.urdf")
"""The PR2 in the package."""

_PARTS = {"head_pan_link": ("head", "torso_lift_link")}
"""Links of the source that ours has under another name, and the source's link of the same frame."""


@dataclass(frozen=True, kw_only=True)
class LinkMesh:
    """A mesh that a link wears.

    Attributes:
        link: Name of the link in models/pr2/pr2.urdf.
        path: The mesh's file.
        scale: Along its axes, shape (3,).
        X_LM: Pose of the mesh in the link's frame.
        color: RGBA, shape (4,), each 0 to 1; None where the file has colours of its own.
    """

    link: str
    path: Path
    scale: Vector
    X_LM: RigidTransform
    color: Vector | None


def read_pr2_meshes(package: Path) -> list[LinkMesh]:
    """Returns what the links look like, gripper closed and head level, as in our model.

    Args:
        package: Folder of package://drake_models.

    Raises:
        ModelError: It has no PR2, or one that cannot be read.
    """
    path = package / DESCRIPTION
    try:
        meshes = _place(*_parse(_looks_only(path), package))
    except (OSError, ElementTree.ParseError, RuntimeError) as error:
        reason = " ".join(str(error).split())
        raise ModelError(f"the PR2's meshes cannot be read from {path}: {reason}") from None
    if not meshes:
        raise ModelError(f"{path} has no mesh for any link of models/pr2/pr2.urdf")
    return meshes


def _place(
    plant: MultibodyPlant, scene_graph: SceneGraph, pr2: ModelInstanceIndex
) -> list[LinkMesh]:
    """Returns the meshes of the source in the frames of our links."""
    ours = _own_links()
    context = plant.CreateDefaultContext()
    parents = {
        joint.child_body().index(): joint.parent_body().index()
        for joint in map(plant.get_joint, plant.GetJointIndices())
    }
    meshes = []
    inspector = scene_graph.model_inspector()
    for index in plant.GetBodyIndices(pr2):
        body = plant.get_body(index)
        X_WB = plant.EvalBodyPoseInWorld(context, body)
        name = _carrier(plant, index, parents, {*ours, *_PARTS})
        link, frame = _PARTS.get(name, (name, name))
        if link not in ours:
            continue
        X_LW = plant.GetFrameByName(frame, pr2).CalcPoseInWorld(context).inverse()
        for geometry in plant.GetVisualGeometriesForBody(body):
            mesh = inspector.GetShape(geometry)
            if isinstance(mesh, Mesh):  # Boxes of the source mark frames.
                meshes.append(
                    LinkMesh(
                        link=link,
                        path=Path(mesh.source().path()),
                        scale=np.array(mesh.scale3()),
                        X_LM=X_LW @ X_WB @ inspector.GetPoseInFrame(geometry),
                        color=_color(inspector.GetIllustrationProperties(geometry)),
                    )
                )
    return meshes


def _carrier(
    plant: MultibodyPlant,
    body: BodyIndex,
    parents: Mapping[BodyIndex, BodyIndex],
    known: Collection[str],
) -> str:
    """Returns the name of a body, or of the nearest one below it that is known."""
    while plant.get_body(body).name() not in known and body in parents:
        body = parents[body]
    name: str = plant.get_body(body).name()
    return name


def _color(properties: GeometryProperties | None) -> Vector | None:
    """Returns the colour that the source paints a mesh in."""
    if properties is None or not properties.HasProperty("phong", "diffuse"):
        return None
    return np.array(cast(Rgba, properties.GetProperty("phong", "diffuse")).rgba)


def _looks_only(path: Path) -> str:
    """Returns a description without what is to be hit: those meshes would be loaded, too."""
    tree = ElementTree.parse(path)
    for link in tree.iter("link"):
        for collision in link.findall("collision"):
            link.remove(collision)
    return ElementTree.tostring(tree.getroot(), encoding="unicode")


def _parse(
    description: str, package: Path
) -> tuple[MultibodyPlant, SceneGraph, ModelInstanceIndex]:
    plant, scene_graph = MultibodyPlant(time_step=0.0), SceneGraph()
    plant.RegisterAsSourceForSceneGraph(scene_graph)
    parser = Parser(plant)
    packages = PackageMap.MakeEmpty()
    packages.Add(PACKAGE, package)
    parser.package_map().Remove(PACKAGE)
    parser.package_map().AddMap(packages)
    with _quiet():
        (pr2,) = parser.AddModelsFromString(description, "urdf")
        plant.Finalize()
    return plant, scene_graph, pr2


def _own_links() -> set[str]:
    """Returns the links of our model that can be seen."""
    plant, scene_graph = MultibodyPlant(time_step=0.0), SceneGraph()
    plant.RegisterAsSourceForSceneGraph(scene_graph)
    pr2 = add_pr2(plant)
    inspector = scene_graph.model_inspector()
    return {
        plant.get_body(index).name()
        for index in plant.GetBodyIndices(pr2)
        if inspector.GetGeometries(plant.GetBodyFrameIdOrThrow(index), Role.kIllustration)
    }


@contextmanager
def _quiet() -> Iterator[None]:
    """Keeps Drake's remarks on tags that it does not read off the terminal."""
    logger = logging.getLogger("drake")
    level = logger.level
    logger.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        logger.setLevel(level)
