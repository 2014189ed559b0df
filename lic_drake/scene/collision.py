"""Collision checks of the arm with clutter, board and the robot's own body."""

from dataclasses import replace
from typing import cast

import numpy as np
from pydrake.geometry import CollisionFilterDeclaration, GeometryId, GeometrySet, QueryObject
from pydrake.systems.framework import Context, DiagramBuilder

from lic_drake.clutter.instance import ClutterInstance
from lic_drake.robots.arm import Arm
from lic_drake.scene.contact import ContactConfig
from lic_drake.scene.scene import Scene, SceneConfig, add_scene
from lic_drake.types import Vector

# Collisions are those of the shapes: fine contact meshes of a thick arm take 300 MB and seconds.
_COARSE = SceneConfig(contact=ContactConfig(skin_mesh_m=1.0, object_mesh_m=1.0))


def is_touching(scene: Scene, root: Context) -> bool:
    """Returns whether the arm touches anything, in a root context of the scene's diagram."""
    context = scene.scene_graph.GetMyContextFromRoot(root)
    query = cast(QueryObject, scene.scene_graph.get_query_output_port().Eval(context))
    # Objects that an earlier reach pushed together may touch each other.
    return bool(query.HasCollisions()) and any(
        pair.id_A in scene.skin_links or pair.id_B in scene.skin_links
        for pair in query.ComputePointPairPenetration()
    )


class CollisionChecker:
    """A mobile robot in front of the fixed objects of an environment, all that it knows of it.

    Stems, even fixed ones, are hidden by the board and left out.

    Attributes:
        plant: Robot and objects, with the positions of `Arm.positions`; only collisions of the arm
            are detected.
        plant_context: Its context, in which `touches` sets positions.
    """

    def __init__(self, arm: Arm, instance: ClutterInstance) -> None:
        self._arm = arm
        builder = DiagramBuilder()
        fixed = replace(instance.subset(np.flatnonzero(~instance.movable)), stems=None)
        self._scene = add_scene(builder, arm, fixed, _COARSE, mobile=True)
        others = GeometrySet([*self._scene.objects, *self._scene.body])
        self._scene.scene_graph.collision_filter_manager().Apply(
            CollisionFilterDeclaration().ExcludeWithin(others)
        )
        self._diagram = builder.Build()
        self._root = self._diagram.CreateDefaultContext()
        self.plant = self._scene.plant
        self.plant_context = self.plant.GetMyMutableContextFromRoot(self._root)

    def touches(self, b0: Vector, q: Vector) -> bool:
        """Returns whether the arm touches anything, at b0 (3,), metres, and q (m,), radians."""
        positions = self._arm.positions(b0, q)
        self.plant.SetPositions(self.plant_context, self._scene.arm, positions)
        return is_touching(self._scene, self._root)

    def touching_links(self, b0: Vector, q: Vector) -> list[str]:
        """Returns the pairs of links or objects that touch, as `touches` says, in words."""
        if not self.touches(b0, q):
            return []
        context = self._scene.scene_graph.GetMyContextFromRoot(self._root)
        query = cast(QueryObject, self._scene.scene_graph.get_query_output_port().Eval(context))
        inspector = query.inspector()

        def link(geometry: GeometryId) -> str:
            return inspector.GetName(inspector.GetFrameId(geometry)).split("::")[-1]

        pairs = query.ComputePointPairPenetration()
        return sorted({f"{link(pair.id_A)} and {link(pair.id_B)}" for pair in pairs})

    def first_free(self, b0: Vector, angles: Vector) -> Vector | None:
        """Returns the first collision-free joint angles of `angles`, shape (n, m)."""
        return next((q for q in angles if not self.touches(b0, q)), None)
