"""The controller as a system: what it makes of its ports, and when."""

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from support.kinematics import link_origins
from support.worlds import ARM, LAYOUT

from lic_drake.control.mpc import PRESETS, HapticMpc, MpcInput
from lic_drake.control.mpc_controller import HapticMpcController

Q = np.deg2rad([-30.0, 60.0, 50.0])
GOAL = np.array([0.5, -0.3, 0.0])


@pytest.mark.parametrize("preset", ["haptic_mpc_2013", "ijrr_2013"])
def test_the_desired_state_is_one_mpc_step_on_with_no_velocity(preset: str) -> None:
    forces = np.zeros(188)
    forces[[60, 140, 181]] = [3.0, 7.0, 2.0]
    forces[20] = PRESETS[preset]().force_trim_N  # Ignored.
    q_d = Q + np.array([0.02, -0.03, 0.01])
    config = PRESETS[preset]()
    controller = HapticMpcController(ARM, LAYOUT, config)
    context = controller.CreateDefaultContext()
    controller.GetInputPort("arm_state").FixValue(context, np.append(Q, np.zeros(3)))
    controller.GetInputPort("taxel_force").FixValue(context, forces)
    controller.GetInputPort("goal").FixValue(context, GOAL)
    context.SetDiscreteState(np.append(q_d, np.zeros(3)))
    # Taxels and Jacobians by Drake-free formulas of their own: planar geometry, link by link.
    contacts = []
    for taxel in (60, 140, 181):
        link = LAYOUT.link[taxel]
        angle = np.cumsum(Q)[link]
        c, s = np.cos(angle), np.sin(angle)
        turn = np.array([[c, -s], [s, c]])
        point = link_origins(ARM, Q)[link] + turn @ LAYOUT.p_LT[taxel, :2]
        p_JQ = point - link_origins(ARM, Q)[:3]
        jacobian = np.vstack([-p_JQ[:, 1], p_JQ[:, 0], np.zeros(3)])
        jacobian[:, link + 1 :] = 0.0
        contacts.append((np.append(turn @ LAYOUT.n_L[taxel, :2], 0.0), jacobian))
    state = MpcInput(
        q=Q,
        q_d=q_d,
        p_EG=GOAL - ARM.calc_pose(Q).p_RE,
        Jv_E=ARM.calc_pose(Q).Jv_E,
        normals=np.array([normal for normal, _ in contacts]),
        forces=np.array([3.0, 7.0, 2.0]),
        Jv_C=np.array([jacobian for _, jacobian in contacts]),
    )
    expected = q_d + HapticMpc(config, ARM.stiffness, ARM.q_min, ARM.q_max).step(state)
    assert np.linalg.norm(expected - q_d) > 1e-4
    Simulator(controller, context).AdvanceTo(1e-6)
    desired = controller.GetOutputPort("desired_state").Eval(context)
    np.testing.assert_allclose(desired, np.append(expected, np.zeros(3)), atol=1e-12)
