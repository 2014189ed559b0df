import numpy as np
import pytest
from pydrake.geometry import TriangleSurfaceMesh, VolumeMesh
from pydrake.multibody.plant import CalcContactFrictionFromSurfaceProperties, ContactResults
from worlds import ARM, World, box, cylinder, make_clutter, make_world

from lic_drake.scene.contact import ContactConfig, object_properties, skin_properties
from lic_drake.scene.scene import SceneConfig

BENT = np.deg2rad([-30.0, 60.0, 50.0])


def contact_results(world: World) -> ContactResults:
    return world.scene.plant.get_contact_results_output_port().Eval(world.plant_context)


@pytest.mark.parametrize("mu", [0.0, 0.2, 0.5])
def test_friction_of_arm_on_object_is_twice_that_of_object_on_object(mu: float) -> None:
    config = ContactConfig(object_friction=mu)
    skin, item = skin_properties(config), object_properties(config)
    for first, second, expected in ((item, item, mu), (skin, item, 2.0 * mu)):
        combined = CalcContactFrictionFromSurfaceProperties(
            first.GetProperty("material", "coulomb_friction"),
            second.GetProperty("material", "coulomb_friction"),
        )
        assert combined.static_friction() == pytest.approx(expected, abs=1e-6)
        assert combined.dynamic_friction() == pytest.approx(expected, abs=1e-6)


def test_every_geometry_of_the_arm_is_compliant_and_every_object_is_rigid() -> None:
    config = SceneConfig(contact=ContactConfig(skin_modulus_Pa=2e7, dissipation_s_per_m=0.5))
    clutter = make_clutter(
        cylinder(0.6, 0.0), cylinder(0.7, 0.0, movable=True), box(0.5, 0.5, (0.1, 0.1, 0.1))
    )
    scene = make_world(BENT, clutter, config).scene
    inspector = scene.scene_graph.model_inspector()
    geometries = scene.plant.GetCollisionGeometriesForBody
    bodies = [scene.plant.get_body(i) for i in scene.plant.GetBodyIndices(scene.clutter)]
    objects = [
        *geometries(scene.plant.world_body()),
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
        properties = inspector.GetProximityProperties(geometry)
        assert properties.GetProperty("material", "hunt_crossley_dissipation") == 0.5


def test_friction_of_the_sliding_arm_on_a_fixed_object_is_measured_as_0_4() -> None:
    R_RL, p_RL = ARM.link_poses(BENT)
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
    to_joints = np.linalg.pinv(ARM.tip_jacobian(BENT))
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


def test_the_arm_does_not_pass_through_a_fixed_object() -> None:
    R_RL, p_RL = ARM.link_poses(BENT)
    normal, along = R_RL[2, :, 0], -R_RL[2, :, 1]
    centre = p_RL[2] + 0.2 * along + 0.028 * normal
    contact = ContactConfig(skin_modulus_Pa=1e8, skin_mesh_m=0.005, object_mesh_m=0.004)
    world = make_world(
        BENT, make_clutter(cylinder(*centre[:2])), SceneConfig(time_step_s=0.005, contact=contact)
    )
    world.set_equilibrium(BENT + np.linalg.pinv(ARM.tip_jacobian(BENT)) @ (0.08 * normal))
    world.advance(4.0)
    R_RL, p_RL = ARM.link_poses(world.q)
    gap = (centre - p_RL[2]) @ R_RL[2, :, 0] - 0.025
    assert -1e-3 < gap < 0.0
