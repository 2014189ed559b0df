"""The tactile sensor in simulated contact, against the forces that were applied."""

import numpy as np
import pytest
from pydrake.geometry import (
    AddCompliantHydroelasticProperties,
    AddContactMaterial,
    AddRigidHydroelasticProperties,
    Cylinder,
    GeometryId,
    ProximityProperties,
    Sphere,
)
from pydrake.math import RigidTransform
from pydrake.multibody.plant import (
    AddMultibodyPlant,
    ContactResults,
    CoulombFriction,
    MultibodyPlantConfig,
)
from pydrake.multibody.tree import SpatialInertia, UnitInertia
from pydrake.systems.framework import DiagramBuilder
from support.worlds import (
    ARM,
    LAYOUT,
    World,
    add_sensor,
    box,
    controller_input,
    cylinder,
    make_clutter,
    make_world,
)

from lic_drake.clutter.instance import ClutterInstance
from lic_drake.control.tactile_sensor import read_patches
from lic_drake.scene import scene as scene_module
from lic_drake.scene.contact import ContactConfig, object_properties
from lic_drake.scene.scene import SceneConfig

BENT = np.deg2rad([-30.0, 60.0, 50.0])


def press(
    world: World, body: str, link: int, normal_L: np.ndarray, force: float, duration: float = 3.0
) -> None:
    """Presses an object on a link with a force that follows the link's normal as it yields."""
    for _ in range(round(duration / 0.1)):
        normal = ARM.calc_pose(world.q)[:2][0][link] @ normal_L
        world.push(body, np.zeros(3), -force * normal)
        world.advance(0.1)


def object_at(taxel: int, clearance: float = 1e-4, along: float = 0.0) -> ClutterInstance:
    """A movable cylinder just off a taxel, `along` metres further in the row."""
    R_RL, p_RL = ARM.calc_pose(BENT)[:2]
    link = LAYOUT.link[taxel]
    p_LO = LAYOUT.p_LT[taxel] + (0.01 + clearance) * LAYOUT.n_L[taxel] + [0.0, along, 0.0]
    return cylinder(*(p_RL[link] + R_RL[link] @ p_LO)[:2], movable=True)


def contact(
    modulus: float = 1e8, skin_mesh: float = 0.005, object_mesh: float = 0.004
) -> SceneConfig:
    """Hardly any ground friction, so that what is applied to an object presses on the arm."""
    return SceneConfig(
        time_step_s=0.0025,
        ground_friction_N=1e-3,
        contact=ContactConfig(
            skin_modulus_Pa=modulus, skin_mesh_m=skin_mesh, object_mesh_m=object_mesh
        ),
    )


def joint_torques(world: World, forces: np.ndarray) -> np.ndarray:
    """What the taxels' forces do to the joints, through the taxels' Jacobians."""
    loaded = np.flatnonzero(forces)
    state = controller_input(world.q, loaded, forces[loaded])
    return -np.einsum("i,ij,ijk->k", state.forces, state.normals, state.Jv_C)


# Sides of all links and both caps of the last one: link 3's first side is taxels 124..150, the
# other 151..177, the caps 178..187.
@pytest.mark.parametrize("taxel", [25, 58, 144, 180])
def test_a_pressed_cylinder_reads_its_force_on_its_taxel_and_bends_the_arm_by_statics(
    taxel: int,
) -> None:
    force = 5.0
    world = make_world(BENT, make_clutter(object_at(taxel)), contact(), add_sensor)
    press(world, "object0", LAYOUT.link[taxel], LAYOUT.n_L[taxel], force)
    forces = world.taxel_force
    assert np.flatnonzero(forces).tolist() == [taxel]
    assert forces.sum() == pytest.approx(force, rel=0.01)
    # The contact may be 5 mm off its taxel: 1 mNm a newton.
    torques = joint_torques(world, forces)
    deflection = ARM.stiffness * (world.q - BENT)
    np.testing.assert_allclose(deflection, torques, rtol=0.02, atol=2e-3 * force)


@pytest.mark.parametrize(
    ("modulus", "skin_mesh", "object_mesh"), [(1e8, 0.01, 0.01), (1e7, 0.003, 0.002)]
)
def test_the_reading_depends_neither_on_the_contact_meshes_nor_on_the_skins_modulus(
    modulus: float, skin_mesh: float, object_mesh: float
) -> None:
    clutter = make_clutter(object_at(139, along=0.0023))
    world = make_world(BENT, clutter, contact(modulus, skin_mesh, object_mesh), add_sensor)
    press(world, "object0", 2, LAYOUT.n_L[139], 3.0, 2.0)
    assert world.taxel_force.sum() == pytest.approx(3.0, rel=0.01)
    assert set(np.flatnonzero(world.taxel_force)) <= {138, 139}


def test_a_wall_along_the_arm_loads_many_taxels_with_its_whole_force() -> None:
    R_RL, p_RL = ARM.calc_pose(BENT)[:2]
    centre = p_RL[2] + R_RL[2] @ [0.0151 + 0.01, -0.14, 0.0]
    yaw = float(np.arctan2(R_RL[2, 1, 1], R_RL[2, 0, 1]))
    wall = box(*centre[:2], (0.16, 0.02, 0.1), yaw, movable=True)
    world = make_world(BENT, make_clutter(wall), contact(1e5), add_sensor)
    # The wall cannot turn with the arm: only a soft skin and a small force keep it flat.
    press(world, "object0", 2, np.array([1.0, 0.0, 0.0]), 0.5)
    forces = world.taxel_force
    loaded = np.flatnonzero(forces)
    assert forces.sum() == pytest.approx(0.5, rel=0.02)
    assert len(loaded) >= 3
    assert set(LAYOUT.link[loaded]) == {2}
    np.testing.assert_array_equal(LAYOUT.n_L[loaded, 0], 1.0)


def test_point_contacts_are_read_as_well(monkeypatch: pytest.MonkeyPatch) -> None:
    # A rigid skin: Drake then falls back to point contact without a word.
    monkeypatch.setattr(scene_module, "skin_properties", object_properties)
    world = make_world(BENT, make_clutter(object_at(144)), contact(), add_sensor)
    press(world, "object0", 2, LAYOUT.n_L[144], 4.0)
    results = world.scene.plant.get_contact_results_output_port().Eval(world.plant_context)
    assert (results.num_hydroelastic_contacts(), results.num_point_pair_contacts()) == (0, 1)
    forces = world.taxel_force
    assert np.flatnonzero(forces).tolist() == [144]
    assert forces[144] == pytest.approx(4.0, rel=0.01)
    deflection = ARM.stiffness * (world.q - BENT)
    np.testing.assert_allclose(deflection, joint_torques(world, forces), rtol=0.02, atol=0.01)


def pressed_pair(first_soft: bool, second_soft: bool) -> tuple[ContactResults, list[GeometryId]]:
    """A body below and one above it, overlapping by 5 mm; the lower one is registered first."""
    builder = DiagramBuilder()
    config = MultibodyPlantConfig(time_step=1e-3, use_sampled_output_ports=False)
    plant, _ = AddMultibodyPlant(config, builder)
    geometries = []
    for name, shape, soft in (
        ("below", Cylinder(0.05, 0.1), first_soft),
        ("above", Sphere(0.05), second_soft),
    ):
        body = plant.AddRigidBody(
            name, SpatialInertia(1.0, np.zeros(3), UnitInertia.SolidSphere(0.05))
        )
        properties = ProximityProperties()
        AddContactMaterial(0.0, 1e4, CoulombFriction(0.0, 0.0), properties)
        if soft:
            AddCompliantHydroelasticProperties(0.02, 1e6, properties)
        else:
            AddRigidHydroelasticProperties(0.02, properties)
        geometries.append(
            plant.RegisterCollisionGeometry(body, RigidTransform(), shape, name, properties)
        )
    plant.Finalize()
    diagram = builder.Build()
    context = diagram.CreateDefaultContext()
    plant_context = plant.GetMyMutableContextFromRoot(context)
    plant.SetFreeBodyPose(
        plant_context, plant.GetBodyByName("above"), RigidTransform(p=[0.0, 0.0, 0.095])
    )
    return plant.get_contact_results_output_port().Eval(plant_context), geometries


@pytest.mark.parametrize(
    ("first_soft", "second_soft"), [(True, False), (False, True), (True, True), (False, False)]
)
def test_the_sign_of_a_force_does_not_depend_on_which_body_drake_names_first(
    first_soft: bool, second_soft: bool
) -> None:
    results, (below, above) = pressed_pair(first_soft, second_soft)
    assert results.num_hydroelastic_contacts() == int(first_soft or second_soft)
    (of_below,) = read_patches(results, {below: 4}.get)
    (of_above,) = read_patches(results, {above: 7}.get)
    assert (of_below.link, of_above.link) == (4, 7)
    # The lower body's force on the upper one points up.
    f_below = of_below.force @ of_below.n_R
    assert f_below[2] > 1.0
    np.testing.assert_allclose(of_above.force, of_below.force, atol=1e-9)
    np.testing.assert_allclose(of_above.n_R, -of_below.n_R, atol=1e-12)
    np.testing.assert_allclose(of_below.p_RQ[:, 2], 0.0475, atol=3e-3)
    assert read_patches(results, {}.get) == []
