"""Meshes change what is seen of a robot, and nothing else."""

from pathlib import Path
from typing import Any

from pydrake.geometry import Mesh, Role
from pydrake.systems.framework import DiagramBuilder
from support.mesh_package import write_drake_models

from lic_drake.clutter.instance import join
from lic_drake.robots.pr2 import Pr2Arm
from lic_drake.scene.scene import Scene, SceneConfig, add_scene
from lic_drake.show.meshes import wear_meshes
from lic_drake.show.pr2_meshes import read_pr2_meshes


def dressed(package: Path | None) -> Scene:
    scene = add_scene(DiagramBuilder(), Pr2Arm(), join(), SceneConfig(), visuals=True)
    wear_meshes(scene, read_pr2_meshes(package) if package else [])
    return scene


def physics(scene: Scene) -> list[Any]:
    """Everything that a simulation knows of the robot."""
    plant, inspector = scene.plant, scene.scene_graph.model_inspector()
    context = plant.CreateDefaultContext()
    plant.SetPositions(context, Pr2Arm().q_home)
    known: list[Any] = [plant.CalcMassMatrix(context).tolist()]
    for index in plant.GetBodyIndices(scene.arm):
        for geometry in plant.GetCollisionGeometriesForBody(plant.get_body(index)):
            properties = inspector.GetProximityProperties(geometry)
            assert properties is not None
            known.append(
                (
                    inspector.GetName(geometry),
                    str(inspector.GetShape(geometry)),
                    inspector.GetPoseInFrame(geometry).GetAsMatrix34().tolist(),
                    str(properties),
                )
            )
    known.append(inspector.GetCollisionCandidates().__len__())
    return known


def test_physics_is_the_same_with_meshes(tmp_path: Path) -> None:
    bare, worn = physics(dressed(None)), physics(dressed(write_drake_models(tmp_path)))
    assert bare == worn
    assert len(bare) > 20


def test_dressed_links_show_their_meshes_only_and_the_others_what_they_showed(
    tmp_path: Path,
) -> None:
    bare, worn = dressed(None), dressed(write_drake_models(tmp_path))
    for role in (Role.kIllustration, Role.kPerception):
        for index in worn.plant.GetBodyIndices(worn.arm):
            name = worn.plant.get_body(index).name()
            shapes, before = (
                [
                    scene.scene_graph.model_inspector().GetShape(geometry)
                    for geometry in scene.scene_graph.model_inspector().GetGeometries(
                        scene.plant.GetBodyFrameIdOrThrow(index), role
                    )
                ]
                for scene in (worn, bare)
            )
            meshes = [shape for shape in shapes if isinstance(shape, Mesh)]
            number = {"base_link": 1, "torso_lift_link": 1, "head": 2, "r_upper_arm_roll_link": 2}
            assert len(meshes) == number.get(name, 0)
            assert len(shapes) == (len(meshes) or len(before))
