"""What the controller predicts of a step against what the simulated arm then does."""

import numpy as np
import pytest
from support.worlds import (
    ARM,
    World,
    add_sensor,
    controller_input,
    cylinder,
    make_clutter,
    make_world,
)

from lic_drake.control.mpc import HapticMpc, MpcConfig, MpcInput
from lic_drake.scene.contact import ContactConfig
from lic_drake.scene.scene import SceneConfig

Q = np.deg2rad([-30.0, 60.0, 50.0])


def pressed_world(modulus: float, radius: float) -> World:
    """Link 3 presses on a slippery fixed cylinder: the model knows no friction."""
    R_RL, p_RL = ARM.calc_pose(Q)[:2]
    across, along = R_RL[2, :, 0], -R_RL[2, :, 1]
    obstacle = cylinder(*(p_RL[2] + 0.2 * along + (0.015 + radius) * across)[:2], radius=radius)
    contact = ContactConfig(
        skin_modulus_Pa=modulus, skin_mesh_m=0.005, object_mesh_m=0.002, object_friction=0.0
    )
    world = make_world(
        Q, make_clutter(obstacle), SceneConfig(time_step_s=0.005, contact=contact), add_sensor
    )
    world.set_equilibrium(Q + np.linalg.pinv(ARM.calc_pose(Q).Jv_E) @ (0.03 * across))
    world.advance(8.0)
    return world


def measure(world: World, q_d: np.ndarray, p_EG: tuple[float, ...] = (0.0,) * 3) -> MpcInput:
    """The controller's input in the present state of the world."""
    forces = world.taxel_force
    loaded = np.flatnonzero(forces)
    return controller_input(world.q, loaded, forces[loaded], q_d, p_EG)


def test_a_step_moves_hand_and_force_as_predicted_once_the_arm_has_settled() -> None:
    world = pressed_world(1e8, 0.01)  # About the reference simulator's contact.
    plant = world.scene.plant
    port = plant.get_desired_state_input_port(world.scene.arm)
    q_d = np.array(port.Eval(world.plant_context))[:3]
    before = measure(world, q_d)
    assert len(before.forces) == 1
    assert before.forces[0] > 1.0
    row = before.normals[0] @ before.Jv_C[0]

    # How stiff the contact is, from one small step towards it.
    world.set_equilibrium(q_d + 0.01 * row / np.linalg.norm(row))
    world.advance(2.5)
    k = (world.taxel_force.sum() - before.forces[0]) / (row @ (world.q - before.q))
    assert 2e4 < k < 1e5
    config = MpcConfig(contact_stiffness_N_per_m=float(k))
    mpc = HapticMpc(config, ARM.stiffness, ARM.q_min, ARM.q_max)

    for goal in ((0.3, 0.0, 0.0), (-0.3, 0.1, 0.0), (0.1, -0.4, 0.0)):
        world.set_equilibrium(q_d)
        world.advance(2.5)
        start = measure(world, q_d, goal)
        step = mpc.step(start)
        world.set_equilibrium(q_d + step)
        world.advance(2.5)
        model = mpc.predict(start)
        moved = ARM.calc_pose(world.q).p_RE - ARM.calc_pose(start.q).p_RE
        expected = model.tip @ step
        assert np.linalg.norm(expected) > 2e-4
        assert np.linalg.norm(moved - expected) < 0.1 * np.linalg.norm(expected)
        change = world.taxel_force.sum() - start.forces[0]
        assert change == pytest.approx(float((model.force @ step)[0]), rel=0.1, abs=0.01)
