import numpy as np
import pytest
from pydrake.geometry import TriangleSurfaceMesh, VolumeMesh
from pydrake.multibody.plant import CalcContactFrictionFromSurfaceProperties, ContactResults
from support.worlds import ARM, World, box, cylinder, gap_to_boxes, make_clutter, make_world

from lic_drake.clutter.instance import ClutterInstance
from lic_drake.scene.contact import ContactConfig, object_properties, skin_properties
from lic_drake.scene.scene import SceneConfig

BENT = np.deg2rad([-30.0, 60.0, 50.0])


def contact_results(world: World) -> ContactResults:
    return world.scene.plant.get_contact_results_output_port().Eval(world.plant_context)


def test_friction_of_arm_on_object_is_twice_that_of_object_on_object() -> None:
    mu = 0.3
    config = ContactConfig(object_friction=mu)
    skin, item = skin_properties(config), object_properties(config)
    for first, second, expected in ((item, item, mu), (skin, item, 2.0 * mu)):
        combined = CalcContactFrictionFromSurfaceProperties(
            first.GetProperty("material", "coulomb_friction"),
            second.GetProperty("material", "coulomb_friction"),
        )
        assert combined.static_friction() == combined.dynamic_friction()
        assert combined.dynamic_friction() == pytest.approx(expected, abs=1e-6)


def test_every_geometry_of_the_arm_is_compliant_and_every_object_is_rigid() -> None:
    config = SceneConfig(contact=ContactConfig(skin_modulus_Pa=2e7))
    clutter = make_clutter(
        cylinder(0.6, 0.0), cylinder(0.7, 0.0, movable=True), box(0.5, 0.5, (0.1, 0.1, 0.1))
    )
    scene = make_world(BENT, clutter, config).scene
    inspector = scene.scene_graph.model_inspector()
    geometries = scene.plant.GetCollisionGeometriesForBody
    bodies = [scene.plant.get_body(i) for i in scene.plant.GetBodyIndices(scene.clutter)]
    objects = [
        *geometries(scene.plant.GetBodyByName("surroundings")),
        *(geometry for body in bodies for geometry in geometries(body)),
    ]
    assert len(objects) == 3
    assert sorted(scene.skin_links.values()) == [0, 1, 2]
    for geometry, link in scene.skin_links.items():
        assert geometry in geometries(scene.plant.GetBodyByName(ARM.link_names[link]))
        # Drake meshes the volume of a compliant body and the surface of a rigid one.
        assert isinstance(inspector.maybe_get_hydroelastic_mesh(geometry), VolumeMesh)
        properties = inspector.GetProximityProperties(geometry)
        assert properties.GetProperty("hydroelastic", "hydroelastic_modulus") == 2e7
    for geometry in objects:
        assert isinstance(inspector.maybe_get_hydroelastic_mesh(geometry), TriangleSurfaceMesh)


def test_friction_of_the_sliding_arm_on_a_fixed_object_is_measured_as_0_4() -> None:
    R_RL, p_RL = ARM.calc_pose(BENT)[:2]
    normal, along = R_RL[2, :, 0], -R_RL[2, :, 1]
    centre = p_RL[2] + 0.2 * along + 0.025 * normal
    world = make_world(
        BENT,
        make_clutter(cylinder(*centre[:2])),
        SceneConfig(
            time_step_s=0.0025,
            contact=ContactConfig(skin_modulus_Pa=1e7, skin_mesh_m=0.005, object_mesh_m=0.004),
        ),
    )
    to_joints = np.linalg.pinv(ARM.calc_pose(BENT).Jv_E)
    world.set_equilibrium(BENT + to_joints @ (0.03 * normal))
    world.advance(3.0)
    world.set_equilibrium(BENT + to_joints @ (0.03 * normal + 0.06 * along))
    world.advance(0.5)
    info = contact_results(world).hydroelastic_contact_info(0)
    surface = info.contact_surface()
    pressure = [
        surface.poly_e_MN().EvaluateCartesian(i, surface.centroid(i)) * surface.area(i)
        for i in range(surface.num_faces())
    ]
    normals = np.array([surface.face_normal(i) for i in range(surface.num_faces())])
    total = np.array(info.F_Ac_W().translational())
    direction = np.array(pressure) @ normals
    direction /= np.linalg.norm(direction)
    tangential = total - (total @ direction) * direction
    assert abs(total @ direction) > 1.0
    # Damping (Hunt & Crossley) is part of the force, not of the static pressure: 5 %.
    assert np.linalg.norm(tangential) / abs(total @ direction) == pytest.approx(0.4, rel=0.05)


def test_two_objects_meet_in_point_contact_and_their_friction_is_measured_as_0_2() -> None:
    wall = box(0.8, 0.0, (0.02, 1.0, 0.2))
    world = make_world(
        np.deg2rad([-140.0, 100.0, 120.0]),
        make_clutter(wall, cylinder(0.779, 0.0, movable=True)),
        SceneConfig(time_step_s=0.0025, ground_friction_N=1e-3),
    )
    for along, sliding in ((0.9, False), (3.0, True)):
        world.push("object1", np.zeros(3), np.array([5.0, along, 0.0]))
        world.advance(0.3)
        results = contact_results(world)
        assert results.num_hydroelastic_contacts() == 0
        force = np.abs(results.point_pair_contact_info(0).contact_force())
        assert force[0] == pytest.approx(5.0, rel=0.01)
        assert force[1] / force[0] == pytest.approx(0.2 if sliding else 0.18, rel=0.01)
        assert (abs(world.object_velocities[0, 1]) > 0.1) == sliding


def wall_ahead(distance: float) -> ClutterInstance:
    """A wall of a passage, 2 cm thick, across the way of the hand and in front of its tip."""
    along = -ARM.calc_pose(BENT)[:2][0][2, :, 1]
    centre = ARM.calc_pose(BENT).p_RE + (distance + 0.01) * along
    return box(*centre[:2], (0.02, 0.4, 0.2), yaw=float(np.arctan2(along[1], along[0])))


def test_a_tip_on_a_wall_is_about_as_stiff_as_the_authors_contact_spring() -> None:
    force = []
    for depth in (1.0e-4, 2.0e-4):
        results = contact_results(make_world(BENT, make_clutter(wall_ahead(-depth)), SceneConfig()))
        assert results.num_hydroelastic_contacts() == 1
        info = results.hydroelastic_contact_info(0)
        force.append(np.linalg.norm(info.F_Ac_W().translational()))
    assert force[0] > 0.5
    assert (force[1] - force[0]) / 1.0e-4 == pytest.approx(4.8e4, rel=0.5)


@pytest.mark.parametrize(("speed", "time_step"), [(0.0, 0.0), (1.0, 0.0), (1.0, 0.005)])
def test_a_thin_wall_stops_the_arm_and_bears_what_the_joints_press_with(
    speed: float, time_step: float
) -> None:
    # In a reach nothing moves faster than 0.3 m/s.
    along = -ARM.calc_pose(BENT)[:2][0][2, :, 1]
    clutter = make_clutter(wall_ahead(0.02))
    world = make_world(BENT, clutter, SceneConfig(time_step_s=time_step))
    to_joints = np.linalg.pinv(ARM.calc_pose(BENT).Jv_E) @ along
    q_d = BENT + 0.1 * to_joints
    world.set_equilibrium(q_d)
    plant = world.scene.plant
    plant.SetVelocities(world.plant_context, world.scene.arm, speed * to_joints)
    deepest = 0.0
    for _ in range(250):
        world.advance(0.01)
        deepest = min(deepest, gap_to_boxes(world.q, clutter))
    assert -2e-3 < deepest < 0.0
    assert -5e-4 < gap_to_boxes(world.q, clutter) < 0.0
    results = contact_results(world)
    assert results.num_hydroelastic_contacts() == 1
    info = results.hydroelastic_contact_info(0)
    # The force at the contact that holds the joints against their stiffness and damping. Only its
    # normal part is compared: the tip creeps, and CENIC reports friction by another model.
    v = plant.GetVelocities(world.plant_context, world.scene.arm)
    torque = ARM.stiffness * (q_d - world.q) - ARM.damping * v
    p_WC = np.array([info.contact_surface().centroid()])
    (jacobian,) = ARM.point_jacobians(ARM.calc_pose(world.q), np.array([2]), p_WC)
    expected = np.linalg.pinv(jacobian.T) @ torque @ along
    assert expected > 10.0
    assert abs(info.F_Ac_W().translational() @ along) == pytest.approx(expected, rel=0.01)
