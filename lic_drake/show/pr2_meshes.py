"""Shows the PR2 in the meshes of Drake's own model, package://drake_models."""

import logging
import os
from pathlib import Path

from pydrake.geometry import (
    FrameId,
    GeometryInstance,
    Mesh,
    Role,
    SceneGraph,
)
from pydrake.multibody.parsing import PackageMap, Parser
from pydrake.multibody.plant import MultibodyPlant

from lic_drake.errors import ModelError
from lic_drake.scene.scene import Scene

PACKAGE = "drake_models"
"""Name of the package."""

DESCRIPTION = Path("pr2_description", "urdf", "pr2_simplified.urdf")
"""The PR2 in the package."""

_HEAD_PARTS = ("head_pan_link", "head_tilt_link")  # One link of ours, in the torso's frame.


def find_drake_models() -> Path:
    """Returns the folder of the package, in ROS_PACKAGE_PATH or in the cache of Drake's downloads.

    A ModelError says that it is in neither.
    """
    packages = PackageMap.MakeEmpty()
    packages.PopulateFromRosPackagePath()
    if packages.Contains(PACKAGE):
        return Path(packages.GetPath(PACKAGE))
    os.environ.setdefault("DRAKE_ALLOW_NETWORK", "none")
    try:
        return Path(PackageMap().GetPath(PACKAGE))
    except RuntimeError:
        raise ModelError(
            f"package://{PACKAGE} is not on this machine; name a folder that holds it in"
            " ROS_PACKAGE_PATH, or set DRAKE_ALLOW_NETWORK=package_map to let Drake download it"
        ) from None


def attach_pr2_meshes(scene: Scene, package: Path) -> None:
    """Attaches visual-only meshes in place of the links' shapes; collision geometry is unchanged.

    Gripper closed and head level, as in models/pr2/pr2.urdf. The scene must not be built into a
    diagram yet; `package` is the folder of package://drake_models.

    Raises:
        ModelError: The package has no PR2, or one that cannot be read.
    """
    path = package / DESCRIPTION
    source, source_graph = MultibodyPlant(time_step=0.0), SceneGraph()
    source.RegisterAsSourceForSceneGraph(source_graph)
    parser = Parser(source)
    packages = parser.package_map()
    packages.Remove(PACKAGE)
    packages.Add(PACKAGE, str(package))
    logger = logging.getLogger("drake")
    level = logger.level
    logger.setLevel(logging.CRITICAL)  # Drake warns of tags that it ignores.
    try:
        parser.AddModels(str(path))
        source.Finalize()
        num_meshes = _copy_meshes(scene, source, source_graph)
    except RuntimeError as error:
        reason = " ".join(str(error).split())
        raise ModelError(f"the PR2's meshes cannot be read from {path}: {reason}") from None
    finally:
        logger.setLevel(level)
    if num_meshes == 0:
        raise ModelError(f"{path} has no mesh for any link of models/pr2/pr2.urdf")


def _copy_meshes(scene: Scene, source: MultibodyPlant, source_graph: SceneGraph) -> int:
    """Copies a plant's meshes to the visible links of the scene's robot; returns their number."""
    context, inspector = source.CreateDefaultContext(), source_graph.model_inspector()
    joints = [source.get_joint(index) for index in source.GetJointIndices()]
    parents = {joint.child_body().name(): joint.parent_body().name() for joint in joints}
    source_id, frames = scene.plant.get_source_id(), _visible_links(scene)
    assert source_id is not None
    scene_graph, meshed = scene.scene_graph, list[str]()
    for name in parents:
        link = name  # The nearest link towards the base that the scene's robot has, too.
        while link not in (*frames, *_HEAD_PARTS) and link in parents:
            link = parents[link]
        link, frame = ("head", "torso_lift_link") if link in _HEAD_PARTS else (link, link)
        if link not in frames:
            continue
        body = source.GetBodyByName(name)
        X_WL = source.EvalBodyPoseInWorld(context, source.GetBodyByName(frame))
        X_LB = X_WL.inverse() @ source.EvalBodyPoseInWorld(context, body)
        for old in source.GetVisualGeometriesForBody(body):
            mesh = inspector.GetShape(old)
            if not isinstance(mesh, Mesh):  # Boxes of the source mark frames.
                continue
            X_LM = X_LB @ inspector.GetPoseInFrame(old)
            instance = GeometryInstance(X_LM, mesh, f"mesh{len(meshed)}")
            seen = inspector.GetIllustrationProperties(old)
            rendered = inspector.GetPerceptionProperties(old)
            assert seen is not None and rendered is not None
            if link not in meshed:
                for role in (Role.kIllustration, Role.kPerception):
                    scene_graph.RemoveRole(source_id, frames[link], role)
            new = scene_graph.RegisterGeometry(source_id, frames[link], instance)
            scene_graph.AssignRole(source_id, new, seen)
            scene_graph.AssignRole(source_id, new, rendered)
            meshed.append(link)
    return len(meshed)


def _visible_links(scene: Scene) -> dict[str, FrameId]:
    """Returns the frames of the robot's links that have visual shapes, by name."""
    inspector, plant = scene.scene_graph.model_inspector(), scene.plant
    bodies = [plant.get_body(index) for index in plant.GetBodyIndices(scene.arm)]
    frames = {body.name(): plant.GetBodyFrameIdOrThrow(body.index()) for body in bodies}
    return {
        name: frame
        for name, frame in frames.items()
        if inspector.GetGeometries(frame, Role.kIllustration)
    }
