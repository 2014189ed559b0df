"""Other fixed objects in the context of a scene that is built.

Most of the time that building a scene takes goes into robot and skin, the same in all environments.
"""

from pydrake.geometry import CollisionFilterDeclaration, GeometrySet
from pydrake.systems.framework import Context

from lic_drake.clutter.instance import ClutterInstance
from lic_drake.scene.scene import Scene, make_shape, pose_of


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
