"""The one-step MPC against statics, its written-out cost, and its limits."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.optimize import fsolve
from support.worlds import ARM, LAYOUT, controller_input

from lic_drake.control.mpc import PRESETS, HapticMpc, MpcConfig, MpcInput, solve
from lic_drake.errors import ScenarioError

BOTH = ["haptic_mpc_2013", "ijrr_2013"]
K = np.array([30.0, 20.0, 15.0])


def make_mpc(preset: str = "haptic_mpc_2013", **changes: float) -> HapticMpc:
    config = replace(PRESETS[preset](), **changes)
    return HapticMpc(config, ARM.stiffness, ARM.q_min, ARM.q_max)


def test_the_presets_have_the_published_values() -> None:
    assert list(vars(PRESETS["haptic_mpc_2013"]()).values()) == [
        *(25.0, 5.0, 1.0, 1000.0, 0.02, 0.1, 1.0, 1e-4, 0.0005 * 10.0, True, 0.1),
        *(0.1, np.inf, 0.0, 10.0, 0.5, 30.0, 45.0, True, True, 0.0),
    ]
    speeds = {name: make().tip_step_m / make().period_s for name, make in PRESETS.items()}
    assert speeds == pytest.approx(
        {"haptic_mpc_2013": 0.5, "ijrr_2013": 0.05, "ijrr_2013_25hz": 0.05, "pr2": 0.5}
    )
    assert PRESETS["pr2"]().force_threshold_N == 3.0


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [("rate_hz", 0.0, "from 1 to 1000"), ("fall_below_N", np.nan, "from 0 to inf")],
)
def test_a_value_that_cannot_be_used_is_named(name: str, value: float, said: str) -> None:
    with pytest.raises(ScenarioError, match=f"{name} must be {said}, got {value}"):
        MpcConfig(**{name: value})


@st.composite
def states(draw: st.DrawFn, max_contacts: int = 8, max_force: float = 12.0) -> MpcInput:
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    q = rng.uniform(ARM.q_min, ARM.q_max)
    n = draw(st.integers(0, max_contacts))
    taxels = rng.choice(LAYOUT.num_taxels, size=n, replace=False).tolist()
    forces = rng.uniform(0.5, max_force, size=n).tolist()
    q_d = q + rng.uniform(-0.52, 0.52, size=3)  # Up to the end of the wind-up.
    goal = np.append(rng.uniform(-0.6, 0.6, size=2), 0.0)
    return controller_input(q, taxels, forces, q_d, tuple(goal))


def settle(q_start: np.ndarray, q_d: np.ndarray, taxels: list[int], stiffness: float) -> np.ndarray:
    """Static balance of the arm against springs at taxels, slack at q_start; found by root search.

    The springs act along the taxels' normals at q_start, from the taxels' places there.
    """
    index = np.array(taxels, dtype=int)
    links = LAYOUT.link[index]

    def points(q: np.ndarray) -> np.ndarray:
        R_RL, p_RL = ARM.calc_pose(q)[:2]
        return p_RL[links] + np.einsum("ijk,ik->ij", R_RL[links], LAYOUT.p_LT[index])

    rest = points(q_start)
    normals = np.einsum("ijk,ik->ij", ARM.calc_pose(q_start)[:2][0][links], LAYOUT.n_L[index])

    def torque(q: np.ndarray) -> np.ndarray:
        compression = np.einsum("ij,ij->i", points(q) - rest, normals)
        jacobians = ARM.point_jacobians(ARM.calc_pose(q), links, points(q))
        pull = np.einsum("i,ij,ijk->k", stiffness * compression, normals, jacobians)
        return K * (q_d - q) - pull

    return fsolve(torque, q_start, xtol=1e-13)


@pytest.mark.parametrize("stiffness", [200.0, 5e4])
@pytest.mark.parametrize("taxels", [[], [60], [10, 90, 160, 185]])
def test_the_model_is_the_derivative_of_the_static_balance(
    taxels: list[int], stiffness: float
) -> None:
    q = np.deg2rad([-30.0, 60.0, 50.0])
    mpc = make_mpc(contact_stiffness_N_per_m=stiffness)
    state = controller_input(q, taxels, [1.0] * len(taxels))
    model = mpc.predict(state)
    step = 1e-5
    for joint in range(3):
        delta = step * np.eye(3)[joint]
        above, below = (settle(q, q + sign * delta, taxels, stiffness) for sign in (1.0, -1.0))
        np.testing.assert_allclose(model.joint[:, joint], (above - below) / (2 * step), atol=1e-5)
        tip = (ARM.calc_pose(above).p_RE - ARM.calc_pose(below).p_RE) / (2 * step)
        np.testing.assert_allclose(model.tip[:, joint], tip, atol=1e-5)
        motion = np.einsum("ijk,k->ij", state.Jv_C, (above - below) / (2 * step))
        force = stiffness * np.einsum("ij,ij->i", motion, state.normals)
        np.testing.assert_allclose(model.force[:, joint], force, atol=1e-4 * stiffness)


@pytest.mark.parametrize(
    ("preset", "distance", "expected"),
    [
        ("haptic_mpc_2013", 0.5, 0.02),
        ("haptic_mpc_2013", 0.05, 0.01),
        ("ijrr_2013", 0.5, 0.0005),
        ("ijrr_2013", 0.0002, 0.0002),
    ],
)
def test_the_wanted_tip_motion_points_to_the_goal_and_slows_down_before_it(
    preset: str, distance: float, expected: float
) -> None:
    direction = np.array([0.6, -0.8, 0.0])
    motion = make_mpc(preset).wanted_tip_motion(distance * direction)
    np.testing.assert_allclose(motion, expected * direction, atol=1e-15)


@pytest.mark.parametrize("preset", BOTH)
@settings(max_examples=50)
@given(state=states(), change=st.tuples(*[st.floats(-0.1, 0.1)] * 3))
def test_the_cost_is_that_of_the_published_problem(
    preset: str, state: MpcInput, change: tuple[float, ...]
) -> None:
    mpc, x = make_mpc(preset), np.array(change)
    config, problem = mpc.config, mpc.make_problem(state)

    def published(dphi: np.ndarray) -> float:
        # |dx_d - J_E S dphi|^2 + alpha dphi' K^2 dphi
        #          + w / n_o sum |K_i J_i S dphi + delta n_i|^2
        contact_stiffness = [
            config.contact_stiffness_N_per_m * np.outer(n, n) for n in state.normals
        ]
        total = np.diag(K) + sum(
            (J.T @ K_i @ J for J, K_i in zip(state.Jv_C, contact_stiffness, strict=True)),
            np.zeros((3, 3)),
        )
        S = np.linalg.pinv(total) @ np.diag(K)
        cost = np.sum((mpc.wanted_tip_motion(state.p_EG) - state.Jv_E @ S @ dphi) ** 2)
        cost += config.torque_change_weight * np.sum((K * dphi) ** 2)
        over = [i for i, force in enumerate(state.forces) if force > 5.0]
        share = len(over) if config.force_weight_shared else 1
        for i in over:
            change_of_force = contact_stiffness[i] @ state.Jv_C[i] @ S @ dphi
            wanted = config.force_decrease_N * state.normals[i]
            cost += config.force_weight / share * np.sum((change_of_force + wanted) ** 2)
        return float(cost)

    ours = 0.5 * x @ problem.P @ x + problem.c @ x
    expected = published(x) - published(np.zeros(3))
    assert ours == pytest.approx(expected, rel=1e-8, abs=1e-9)


@pytest.mark.parametrize("preset", BOTH)
@settings(max_examples=100)
@given(state=states())
def test_a_step_keeps_every_limit_of_the_published_problem(preset: str, state: MpcInput) -> None:
    mpc = make_mpc(preset)
    solution = solve(mpc.make_problem(state))
    assume(solution is not None)
    x = mpc.step(state)
    np.testing.assert_array_equal(x, solution)
    model, tolerance = mpc.predict(state), 1e-7
    change, over = model.force @ x, state.forces > 5.0
    # Forces: up to the threshold, by at most 0.1 N a step; over it never up (down, with G1).
    below = ~over
    assert np.all(change[below] <= np.minimum(5.0 - state.forces[below], 0.1) + tolerance)
    joints = state.q + model.joint @ x
    if preset == "haptic_mpc_2013":
        assert np.all(change[over] <= tolerance)
        assert np.all(np.abs(x) <= np.deg2rad(0.5) + tolerance)
        assert np.all(np.abs(state.q_d + x - state.q) <= np.deg2rad(30.0) + tolerance)
        inside = (state.q_d >= ARM.q_min) & (state.q_d <= ARM.q_max)
        next_q_d = (state.q_d + x)[inside]
        assert np.all(next_q_d >= ARM.q_min[inside] - tolerance)
        assert np.all(next_q_d <= ARM.q_max[inside] + tolerance)
    else:
        assert np.all(change[over] <= -0.01 + tolerance)
        assert np.all(change[below] >= -0.1 - tolerance)
    assert np.all(change[over] >= -10.0 - tolerance)
    assert np.all(joints >= ARM.q_min - tolerance)
    assert np.all(joints <= ARM.q_max + tolerance)


@settings(max_examples=100)
@given(states(max_contacts=0))
def test_a_free_step_nears_the_goal_unless_a_joint_limit_or_a_weight_stands_in_the_way(
    state: MpcInput,
) -> None:
    # 0.5 mm a step never meets the rate limit; far from the joint limits nothing else binds.
    margin = 0.1
    assume(np.all(state.q > ARM.q_min + margin) and np.all(state.q < ARM.q_max - margin))
    mpc = make_mpc("ijrr_2013", torque_change_weight=1e-12)
    wanted = mpc.wanted_tip_motion(state.p_EG)
    assume(np.linalg.svd(state.Jv_E[:2], compute_uv=False)[-1] > 0.05)
    np.testing.assert_allclose(state.Jv_E @ mpc.step(state), wanted, atol=1e-7)


@pytest.mark.parametrize("preset", BOTH)
@pytest.mark.parametrize("force", [5.5, 8.0, 30.0])
def test_a_force_over_the_threshold_is_pulled_down_whatever_the_goal(
    preset: str, force: float
) -> None:
    q = np.deg2rad([-30.0, 60.0, 50.0])
    taxel = 140
    push_on = ARM.calc_pose(q)[:2][0][2] @ LAYOUT.n_L[taxel] * 0.3
    mpc = make_mpc(preset)
    state = controller_input(q, [taxel], [force], q_d=q, p_EG=tuple(push_on))
    change = float((mpc.predict(state).force @ mpc.step(state))[0])
    assert change < -0.005 if preset == "ijrr_2013" else change <= 1e-9
    # With the goal where the arm is, the wanted decrease decides.
    resting = controller_input(q, [taxel], [force], q_d=q)
    change = float((mpc.predict(resting).force @ mpc.step(resting))[0])
    assert -mpc.config.force_decrease_N <= change < -0.01


def test_forces_that_cannot_all_fall_make_the_arm_hold_its_equilibrium() -> None:
    # Squeezed from both sides at the same place: no step lowers both forces.
    q = np.deg2rad([-30.0, 60.0, 50.0])
    state = controller_input(q, [130, 157], [8.0, 8.0], q_d=q + 0.05, p_EG=(0.1, 0.0, 0.0))
    np.testing.assert_allclose(state.normals[0], -state.normals[1], atol=1e-12)
    np.testing.assert_array_equal(make_mpc("ijrr_2013").step(state), np.zeros(3))
    # The later controller only forbids them to rise, so it may still move along the contact.
    x = make_mpc().step(state)
    np.testing.assert_allclose(make_mpc().predict(state).force @ x, 0.0, atol=1e-8)


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_joint_beyond_its_limit_goes_no_further_or_comes_back_at_once(side: float) -> None:
    # 0.02 rad is more than the later controller may take back in one step.
    limit = ARM.q_max[2] if side > 0.0 else ARM.q_min[2]
    q = np.array([-0.5, 1.0, limit + 0.02 * side])
    q_d = np.array([-0.5, 1.0, limit])
    for sign in (-1.0, 1.0):
        goal = tuple(0.3 * sign * ARM.calc_pose(q).Jv_E[:, 2])
        state = controller_input(q, [], [], q_d, goal)
        x = make_mpc().step(state)
        assert side * x[2] <= 1e-9
        assert np.linalg.norm(x) > 1e-3
        first = make_mpc("ijrr_2013")
        back = (first.predict(state).joint @ first.step(state))[2]
        assert side * back <= -0.02 + 1e-6
