import numpy as np
from pydrake.geometry import Box, Cylinder, Role
from pydrake.systems.framework import DiagramBuilder
from support.worlds import ARM, box, cylinder, make_clutter, make_world

from lic_drake.scene.scene import SceneConfig, add_scene

PARKED = np.deg2rad([-140.0, 100.0, 120.0])
CLUTTER = make_clutter(
    cylinder(0.6, 0.1, movable=True, mass=0.5),
    box(0.7, -0.2, (0.4, 0.02, 0.2), yaw=0.7),
    box(0.5, 0.3, (0.1, 0.03, 0.2), yaw=-0.4, movable=True),
    cylinder(0.8, 0.0, radius=0.02),
)


def test_objects_stand_where_the_instance_says_with_its_shapes_and_yaw() -> None:
    world = make_world(PARKED, CLUTTER, SceneConfig())
    plant, scene_graph = world.scene.plant, world.scene.scene_graph
    assert plant.num_positions() == 3 + 2 * 2
    masses = [plant.GetBodyByName(name).default_mass() for name in ("object0", "object2")]
    assert masses == [0.5, 1.0]
    inspector = scene_graph.model_inspector()
    query = scene_graph.get_query_output_port().Eval(
        scene_graph.GetMyContextFromRoot(world.context)
    )
    for role, suffix in ((Role.kProximity, "collision"), (Role.kIllustration, "visual")):
        geometries = {
            inspector.GetName(geometry): geometry
            for geometry in inspector.GetAllGeometryIds(role)
            if "object" in inspector.GetName(geometry)
        }
        assert len(geometries) == CLUTTER.num_objects
        for name, geometry in geometries.items():
            i = int(name.split("object")[-1].split("_")[0])
            assert name.endswith(suffix)
            X_WG = query.GetPoseInWorld(geometry)
            np.testing.assert_allclose(X_WG.translation(), CLUTTER.p_WO[i], atol=1e-12)
            yaw = CLUTTER.yaw[i]
            np.testing.assert_allclose(
                X_WG.rotation().matrix()[:, 0], [np.cos(yaw), np.sin(yaw), 0.0], atol=1e-12
            )
            shape = inspector.GetShape(geometry)
            if CLUTTER.shape[i] == "cylinder":
                assert isinstance(shape, Cylinder)
                assert (shape.radius(), shape.length()) == tuple(CLUTTER.size[i, :2])
            else:
                assert isinstance(shape, Box)
                np.testing.assert_array_equal(shape.size(), CLUTTER.size[i])


def test_a_robot_stands_at_the_origin_unless_it_is_placed() -> None:
    for p_WR in (np.zeros(3), np.array([0.1, -0.4, 0.0])):
        builder = DiagramBuilder()
        mobile = bool(np.any(p_WR))
        scene = add_scene(builder, ARM, CLUTTER, SceneConfig(), mobile=mobile)
        diagram = builder.Build()
        context = diagram.CreateDefaultContext()
        plant_context = scene.plant.GetMyMutableContextFromRoot(context)
        assert scene.plant.num_positions(scene.clutter) == 4
        q = np.deg2rad([-30.0, 60.0, 50.0])
        positions = ARM.positions(p_WR, q) if mobile else q
        scene.plant.SetPositions(plant_context, scene.arm, positions)
        # The arm goes along; the clutter does not.
        _, p_RL = ARM.calc_pose(q)[:2]
        for i, name in enumerate(ARM.link_names):
            X_WL = scene.plant.EvalBodyPoseInWorld(
                plant_context, scene.plant.GetBodyByName(name, scene.arm)
            )
            np.testing.assert_allclose(X_WL.translation(), p_RL[i] + p_WR, atol=1e-12)
        np.testing.assert_array_equal(
            scene.plant.GetPositions(plant_context, scene.clutter).reshape(-1, 2),
            CLUTTER.p_WO[CLUTTER.movable, :2],
        )


def test_the_continuous_plant_with_cenic_agrees_with_small_discrete_steps() -> None:
    R_RL, p_RL = ARM.calc_pose(np.deg2rad([-30.0, 60.0, 50.0]))[:2]
    pushed = p_RL[2] - 0.2 * R_RL[2, :, 1] + 0.03 * R_RL[2, :, 0]
    results = []
    for time_step in (0.0, 0.0005):
        q = np.deg2rad([-30.0, 60.0, 50.0])
        clutter = make_clutter(cylinder(*pushed[:2], movable=True))
        world = make_world(q, clutter, SceneConfig(time_step_s=time_step, cenic_accuracy=1e-5))
        world.set_equilibrium(q + np.array([0.2, 0.1, 0.1]))
        world.advance(1.0)
        results.append(np.concatenate([world.q, world.objects[0]]))
    assert np.linalg.norm(results[1][3:] - pushed[:2]) > 0.05
    np.testing.assert_allclose(results[0], results[1], atol=3e-3)
