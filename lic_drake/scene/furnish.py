"""Other fixed objects, and another height of the torso, in the context of a scene that is built.

Most of the time that building a scene takes goes into robot and skin, the same in all environments.
"""

from typing import cast

import numpy as np
from pydrake.geometry import CollisionFilterDeclaration, GeometrySet
from pydrake.math import RigidTransform
from pydrake.multibody.tree import FixedOffsetFrame
from pydrake.systems.framework import Context

from lic_drake.clutter.instance import ClutterInstance
from lic_drake.scene.scene import MOUNT_FRAME, Scene, make_shape, pose_of
from lic_drake.types import Vector


def furnish(scene: Scene, root: Context, instance: ClutterInstance) -> None:
    """Puts the fixed objects of an instance in the places of the scene's.

    Args:
        scene: A scene with as many objects, of which the same ones are fixed.
        root: A context of the diagram that has the scene.
        instance: The objects; its movable ones are not looked at.
    """
    context = scene.scene_graph.GetMyMutableContextFromRoot(root)
    source = scene.plant.get_source_id()
    assert source is not None
    fixed = [geometry for i, geometry in enumerate(scene.objects) if not instance.movable[i]]
    for i, geometry in enumerate(scene.objects):
        if not instance.movable[i]:
            shape = make_shape(instance.shape[i], instance.size[i])
            scene.scene_graph.ChangeShape(context, source, geometry, shape, pose_of(instance, i))
    # A geometry of another shape has forgotten that it belongs to what is welded together.
    scene.scene_graph.collision_filter_manager(context).Apply(
        CollisionFilterDeclaration().ExcludeWithin(GeometrySet([*fixed, *scene.body]))
    )


def raise_torso(scene: Scene, root: Context, torso_frame: str, torso_m: float) -> None:
    """Puts the torso at a height.

    Args:
        scene: A scene with a robot that has a torso.
        root: A context of the diagram that has the scene.
        torso_frame: Name of the frame that carries it, see `lic_drake.robots.arm.Arm`.
        torso_m: The height, metres.
    """
    frame = cast(FixedOffsetFrame, scene.plant.GetFrameByName(torso_frame, scene.arm))
    frame.SetPoseInParentFrame(
        scene.plant.GetMyMutableContextFromRoot(root), RigidTransform(np.array([0.0, 0.0, torso_m]))
    )


def place_robot(scene: Scene, root: Context, b0: Vector) -> None:
    """Places a robot that was added as `placeable`.

    Args:
        scene: The scene.
        root: A context of the diagram that has the scene.
        b0: Base position (x, y) and torso height, shape (3,), metres.
    """
    mount = cast(FixedOffsetFrame, scene.plant.GetFrameByName(MOUNT_FRAME))
    context = scene.plant.GetMyMutableContextFromRoot(root)
    mount.SetPoseInParentFrame(context, RigidTransform(np.array([b0[0], b0[1], 0.0])))
    if scene.torso_frame:
        raise_torso(scene, root, scene.torso_frame, float(b0[2]))
