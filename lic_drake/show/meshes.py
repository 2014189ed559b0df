"""Dresses a robot in meshes: for the eye only, nothing can be hit that was not there before."""

from collections.abc import Sequence

from pydrake.geometry import (
    GeometryInstance,
    IllustrationProperties,
    Mesh,
    PerceptionProperties,
    RenderLabel,
    Rgba,
    Role,
)

from lic_drake.scene.scene import Scene
from lic_drake.show.pr2_meshes import LinkMesh


def wear_meshes(scene: Scene, meshes: Sequence[LinkMesh]) -> None:
    """Shows meshes on the links that have some, instead of what these looked like.

    Collision geometry, masses and joints stay what they are.

    Args:
        scene: The scene, not yet built into a diagram.
        meshes: What the links of its robot wear.
    """
    plant, scene_graph = scene.plant, scene.scene_graph
    source = plant.get_source_id()
    assert source is not None
    frames = {
        link: plant.GetBodyFrameIdOrThrow(plant.GetBodyByName(link, scene.arm).index())
        for link in {mesh.link for mesh in meshes}
    }
    for frame in frames.values():
        for role in (Role.kIllustration, Role.kPerception):
            scene_graph.RemoveRole(source, frame, role)
    for i, mesh in enumerate(meshes):
        shape = Mesh(str(mesh.path), mesh.scale)
        geometry = scene_graph.RegisterGeometry(
            source, frames[mesh.link], GeometryInstance(mesh.X_LM, shape, f"mesh{i}")
        )
        seen, rendered = IllustrationProperties(), PerceptionProperties()
        if mesh.color is not None:
            for properties in (seen, rendered):
                properties.AddProperty("phong", "diffuse", Rgba(*mesh.color))
        rendered.AddProperty("label", "id", RenderLabel.kDontCare)
        scene_graph.AssignRole(source, geometry, seen)
        scene_graph.AssignRole(source, geometry, rendered)
