"""The joint impedance in the plant against statics and an independent integration."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from support.worlds import ARM, make_clutter, make_world

from lic_drake.scene.scene import SceneConfig

Q0 = np.deg2rad([-50.0, 70.0, 120.0])
K = np.array([30.0, 20.0, 15.0])
D = np.array([15.0, 10.0, 8.0])
MASS = np.array([2.835, 2.3, 1.32])
INERTIA = np.array([0.011214, 0.024175, 0.009533])
COM = np.array([0.098, 0.167, 0.1365])
LENGTH = np.array([0.196, 0.334])


def mass_matrix_and_bias(q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Returns M and C v of the planar arm, from its links' Jacobians."""
    angle, rate = np.cumsum(q) - 0.5 * np.pi, np.cumsum(v)
    direction = np.column_stack([np.cos(angle), np.sin(angle)])
    joints = np.vstack([np.zeros(2), np.cumsum(LENGTH[:, None] * direction[:2], axis=0)])
    M, bias = np.zeros((3, 3)), np.zeros(3)
    for i in range(3):
        moves = np.arange(3) <= i
        arm = joints[i] + COM[i] * direction[i] - joints
        J = np.where(moves, np.vstack([-arm[:, 1], arm[:, 0]]), 0.0)
        centripetal = -COM[i] * rate[i] ** 2 * direction[i]
        centripetal -= (LENGTH[:i] * rate[:i] ** 2) @ direction[:i]
        M += MASS[i] * J.T @ J + INERTIA[i] * np.outer(moves, moves)
        bias += MASS[i] * J.T @ centripetal
    return M, bias


@pytest.mark.parametrize("force", [(3.0, -2.0), (-4.0, 1.0)])
def test_a_force_on_the_tip_deflects_the_arm_by_the_joint_compliance(
    force: tuple[float, float],
) -> None:
    world = make_world(Q0, make_clutter(), SceneConfig(time_step_s=0.005))
    f_E_W = np.append(force, 0.0)
    world.push("link3", np.array([0.0, -0.288, 0.0]), f_E_W)
    world.advance(8.0)
    expected = ARM.calc_pose(world.q).Jv_E.T @ f_E_W / K
    np.testing.assert_allclose(world.q - Q0, expected, atol=1e-6)
    assert np.max(np.abs(expected)) > 0.02
    world.push("link3", np.zeros(3), np.zeros(3))
    world.advance(8.0)
    np.testing.assert_allclose(world.q, Q0, atol=1e-6)


@pytest.mark.parametrize("time_step", [0.001, 0.005])
def test_the_step_response_agrees_with_an_integration_of_the_equations_of_motion(
    time_step: float,
) -> None:
    q_d = Q0 + np.array([0.3, -0.2, 0.25])

    def derivative(_: float, y: np.ndarray) -> np.ndarray:
        q, v = y[:3], y[3:]
        M, bias = mass_matrix_and_bias(q, v)
        return np.append(v, np.linalg.solve(M, K * (q_d - q) - D * v - bias))

    times = np.array([0.02, 0.1, 0.3, 1.0, 3.0])
    first = np.append(Q0, np.zeros(3))
    solution = solve_ivp(derivative, (0.0, 3.0), first, "LSODA", times, rtol=1e-9, atol=1e-11)
    world = make_world(Q0, make_clutter(), SceneConfig(time_step_s=time_step))
    world.set_equilibrium(q_d)
    for time, expected in zip(times, solution.y[:3].T, strict=True):
        world.simulator.AdvanceTo(time)
        # First order in the step: 0.12 rad/s at most, of steps of 0.3 rad.
        np.testing.assert_allclose(world.q, expected, atol=0.2 * time_step)


@pytest.mark.parametrize("joint", [0, 1, 2])
@pytest.mark.parametrize("side", ["lower", "upper"])
def test_a_joint_stops_at_its_limit(joint: int, side: str) -> None:
    limit = (ARM.q_min if side == "lower" else ARM.q_max)[joint]
    sign = -1.0 if side == "lower" else 1.0
    q = np.deg2rad([-50.0, 70.0, 80.0])
    q[joint] = limit - 0.1 * sign
    world = make_world(q, make_clutter(), SceneConfig(time_step_s=0.005))
    q_d = q.copy()
    q_d[joint] = limit + 0.2 * sign
    world.set_equilibrium(q_d)
    world.advance(5.0)
    assert sign * (world.q[joint] - limit) == pytest.approx(0.0, abs=2e-3)
