"""Whether an arm touches anything: the clutter, the board, or the robot's own body."""

from dataclasses import replace
from typing import cast

import numpy as np
from pydrake.geometry import CollisionFilterDeclaration, GeometrySet, QueryObject
from pydrake.systems.framework import Context, DiagramBuilder

from lic_drake.clutter.instance import ClutterInstance
from lic_drake.robots.arm import Arm
from lic_drake.scene.scene import Scene, SceneConfig, add_scene
from lic_drake.types import Vector


def is_touching(scene: Scene, root: Context) -> bool:
    """Returns whether the arm touches anything, in a context of the diagram that has the scene."""
    query = cast(
        QueryObject,
        scene.scene_graph.get_query_output_port().Eval(
            scene.scene_graph.GetMyContextFromRoot(root)
        ),
    )
    # Objects that an earlier reach pushed together touch each other, which does not matter.
    return bool(query.HasCollisions()) and any(
        pair.id_A in scene.skin_links or pair.id_B in scene.skin_links
        for pair in query.ComputePointPairPenetration()
    )


class CollisionChecker:
    """A mobile robot in front of the fixed objects of an environment, all that it can see of it.

    Args:
        arm: The arm with the robot that carries it.
        instance: The environment in W.
        config: Gives the contact properties.

    Attributes:
        plant: Robot and objects, with the positions of `Arm.positions`; its geometry has only pairs
            with the arm.
        plant_context: Its context, in which `touches` sets positions.
    """

    def __init__(self, arm: Arm, instance: ClutterInstance, config: SceneConfig) -> None:
        self._arm = arm
        builder = DiagramBuilder()
        self._scene = add_scene(builder, arm, _fixed_part(instance), config, mobile=True)
        self._forget_pairs_without_the_arm()
        self._diagram = builder.Build()
        self._root = self._diagram.CreateDefaultContext()
        self.plant = self._scene.plant
        self.plant_context = self.plant.GetMyMutableContextFromRoot(self._root)

    def touches(self, b0: Vector, q: Vector) -> bool:
        """Returns whether the arm touches anything.

        Args:
            b0: Position of R, shape (3,), metres.
            q: Joint angles, shape (m,), radians.
        """
        positions = self._arm.positions(b0, q)
        self.plant.SetPositions(self.plant_context, self._scene.arm, positions)
        return is_touching(self._scene, self._root)

    def first_free(self, b0: Vector, angles: Vector) -> Vector | None:
        """Returns the first of joint angles, shape (n, m), with which the arm touches nothing."""
        return next((q for q in angles if not self.touches(b0, q)), None)

    def _forget_pairs_without_the_arm(self) -> None:
        """Board and the rest of the robot may be as near to each other as they like."""
        others = GeometrySet([*self._scene.objects, *self._scene.body])
        self._scene.scene_graph.collision_filter_manager().Apply(
            CollisionFilterDeclaration().ExcludeWithin(others)
        )


def _fixed_part(instance: ClutterInstance) -> ClutterInstance:
    """Returns the fixed objects; stems, also fixed ones, are inside, where nobody can look."""
    return replace(instance.subset(np.flatnonzero(~instance.movable)), stems=None)
