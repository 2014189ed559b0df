"""Any arm from its model: kinematics, inverse kinematics, places in a plant, and refusals."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import FixedOffsetFrame, JacobianWrtVariable
from support.five_joint_arm import describe, five_joint_arm

from lic_drake.errors import ScenarioError
from lic_drake.robots.arm import Arm, SkinShape
from lic_drake.robots.kinematics import rigid_pose
from lic_drake.robots.planar import planar_arm
from lic_drake.robots.pr2 import Q_HOME, make_pr2, pr2_arm

ARMS = {"planar": planar_arm(), "pr2": pr2_arm(), "five joints": five_joint_arm()}
FIVE = ARMS["five joints"]
AHEAD = {"planar": (0.335, -0.3, 0.0), "pr2": (0.6, -0.3, 0.8), "five joints": (0.5, -0.1, 0.0)}
"""A place to which each arm can point along x."""
each_arm = pytest.mark.parametrize("name", ARMS)


def middle(arm: Arm, share: float = 0.4) -> np.ndarray:
    return arm.q_min + share * (arm.q_max - arm.q_min)


def angles_of(arm: Arm, rng: np.random.Generator) -> np.ndarray:
    return rng.uniform(arm.q_min, arm.q_max)


@each_arm
@given(st.integers(0, 10_000))
def test_poses_and_jacobians_are_those_of_the_model(name: str, seed: int) -> None:
    arm, rng = ARMS[name], np.random.default_rng(seed)
    plant = MultibodyPlant(time_step=0.0)
    model = arm.add_to_plant(plant)
    plant.Finalize()
    context, world = plant.CreateDefaultContext(), plant.world_frame()
    q = angles_of(arm, rng)
    plant.SetPositions(context, model, q)
    pose = arm.calc_pose(q)
    tip = plant.GetFrameByName(arm.tip_frame, model)
    X_RE = tip.CalcPoseInWorld(context)
    np.testing.assert_allclose(pose.p_RE, X_RE.translation(), atol=1e-12)
    np.testing.assert_allclose(pose.R_RE, X_RE.rotation().matrix(), atol=1e-12)
    links = rng.integers(len(arm.link_names), size=4)
    p_LQ = rng.uniform(-0.3, 0.3, (4, 3)) * [1.0, 1.0, float(not arm.is_planar)]
    p_RQ = pose.p_RL[links] + np.einsum("nij,nj->ni", pose.R_RL[links], p_LQ)
    jacobians = arm.point_jacobians(pose, links, p_RQ)
    kV = JacobianWrtVariable.kV
    for link, p, jacobian in zip(links, p_LQ, jacobians, strict=True):
        frame = plant.GetFrameByName(arm.link_names[link], model)
        X_RL = frame.CalcPoseInWorld(context)
        np.testing.assert_allclose(pose.R_RL[link], X_RL.rotation().matrix(), atol=1e-12)
        np.testing.assert_allclose(pose.p_RL[link], X_RL.translation(), atol=1e-12)
        J = plant.CalcJacobianTranslationalVelocity(context, kV, frame, p, world, world)
        np.testing.assert_allclose(jacobian, J, atol=1e-12)
    J = plant.CalcJacobianSpatialVelocity(context, kV, tip, np.zeros(3), world, world)
    np.testing.assert_allclose(np.vstack([pose.Jw_E, pose.Jv_E]), J, atol=1e-12)
    p_RQ = pose.p_RE + np.zeros((1, 3))
    last = arm.point_jacobians(pose, np.array([len(arm.link_names) - 1]), p_RQ)[0]
    np.testing.assert_allclose(last, pose.Jv_E, atol=1e-12)
    assert np.linalg.norm(pose.p_RE - arm.p_RS) <= arm.reach_m + 1e-12


@each_arm
def test_answers_do_not_depend_on_earlier_ones_and_are_read_only(name: str) -> None:
    arm = ARMS[name]
    q, other = middle(arm), middle(arm, 0.6)
    first = arm.calc_pose(q)
    assert arm.calc_pose(q) is first
    arm.calc_pose(other)
    for before, after in zip(first, arm.calc_pose(q), strict=True):
        np.testing.assert_array_equal(before, after)
        with pytest.raises(ValueError, match="read-only"):
            after[0] = 1.0


@each_arm
@pytest.mark.parametrize("seed", range(3))
def test_inverse_kinematics_bring_the_hand_to_its_pose(name: str, seed: int) -> None:
    arm = ARMS[name]
    q = middle(arm) if seed == 0 else angles_of(arm, np.random.default_rng(seed))
    x0 = arm.tip_pose(q)
    assert len(x0) == arm.pose_size
    p_RE, R_RE = rigid_pose(x0)
    near = arm.solve_ik(x0, near=q)
    np.testing.assert_allclose(near[0], q, atol=1e-6)
    for row in [*near, *arm.solve_ik(x0)[::20]]:
        assert np.all((row >= arm.q_min) & (row <= arm.q_max))
        pose = arm.calc_pose(row)
        np.testing.assert_allclose(pose.p_RE, p_RE, atol=1e-7)
        np.testing.assert_allclose(pose.R_RE, R_RE, atol=1e-7)
    far = x0 + np.eye(arm.pose_size)[0] * 5.0
    assert arm.solve_ik(far).shape == arm.solve_ik(far, q).shape == (0, arm.num_joints)


def test_numerical_inverse_kinematics_find_what_the_closed_form_finds() -> None:
    q = np.array([0.4, 0.9, 1.1])
    planar = Arm("numerical", planar_arm()._model, is_planar=True)
    for x0 in (planar.tip_pose(q), np.array([0.335, -0.1, 1.2])):
        closed = planar_arm().solve_ik(x0)
        found = planar.solve_ik(x0, near=closed[0])
        np.testing.assert_allclose(found[0], closed[0], atol=1e-9)
        assert np.abs(planar.solve_ik(x0) - closed[0]).max(axis=1).min() < 1e-6
    # A turned PR2 has none in closed form, and a pose has infinitely many configurations.
    turned, heading = make_pr2(heading := 0.5), np.array([np.cos(heading), np.sin(heading), 0.0])
    (found,) = turned.solve_pointing(turned.calc_pose(Q_HOME).p_RE[None], heading)
    assert len(found) > 3
    for row in found:
        pose = turned.calc_pose(row)
        np.testing.assert_allclose(pose.p_RE, turned.calc_pose(Q_HOME).p_RE, atol=1e-9)
        np.testing.assert_allclose(pose.R_RE[:, 0], heading, atol=1e-9)


@each_arm
def test_pointing_configurations_come_in_order_of_their_cost(name: str) -> None:
    arm = ARMS[name]
    place, outside = np.array(AHEAD[name]), np.array([3.0, 0.0, 0.0])
    u_R = np.array([1.0, 0.0, 0.0])
    found, nothing = arm.solve_pointing(np.array([place, outside]), u_R)
    assert len(found) > 0
    assert nothing.shape == (0, arm.num_joints)
    assert np.all(np.diff(arm.kinematics.calc_preselection_cost(found)) >= 0.0)
    for q in found[::20]:
        pose = arm.calc_pose(q)
        np.testing.assert_allclose(pose.p_RE, place, atol=1e-7)
        np.testing.assert_allclose(pose.R_RE[:, 0], u_R, atol=1e-7)


@each_arm
def test_r_is_the_given_frame_and_a_mobile_arm_has_b0_among_its_positions(name: str) -> None:
    arm, q = ARMS[name], middle(ARMS[name])
    X_WR = RigidTransform(RollPitchYaw(0.0, 0.0, 0.7), np.array([0.3, -0.2, 0.1]))
    b0 = np.array([0.2, -0.3, 0.25])
    for mobile in (False, True):
        plant = MultibodyPlant(time_step=1e-3)
        frame = plant.AddFrame(FixedOffsetFrame("mount", plant.world_frame(), X_WR))
        model = arm.add_to_plant(plant, frame, mobile)
        plant.Finalize()
        context = plant.CreateDefaultContext()
        positions = arm.positions(b0, q) if mobile else q
        plant.SetPositions(context, model, positions)
        p_WE = plant.GetFrameByName(arm.tip_frame, model).CalcPoseInWorld(context).translation()
        p_RE = arm.calc_pose(q).p_RE + (b0 if mobile else 0.0)
        np.testing.assert_allclose(p_WE, X_WR @ p_RE, atol=1e-12)
        assert not plant.is_gravity_enabled(model)
    np.testing.assert_array_equal(positions, [*b0, *q])
    assert arm.positions(b0, np.tile(q, (2, 1))).shape == (2, 3 + arm.num_joints)


def test_the_pr2s_body_moves_with_the_torso_and_its_arm_does_not() -> None:
    arm, height = pr2_arm(), 0.21
    plant = MultibodyPlant(time_step=1e-3)
    model = arm.add_to_plant(plant, height_m=0.15)
    plant.Finalize()
    context = plant.CreateDefaultContext()
    before = plant.GetFrameByName(arm.tip_frame).CalcPoseInWorld(context)
    for z in (0.15, height):
        if z == height:
            arm.set_height(plant, context, model, z)
        p_RF = plant.GetFrameByName("base_footprint").CalcPoseInWorld(context).translation()
        np.testing.assert_allclose(p_RF, [0.0, 0.0, -z], atol=1e-12)
        tip = plant.GetFrameByName(arm.tip_frame).CalcPoseInWorld(context)
        assert tip.IsNearlyEqualTo(before, 1e-12)
    for z in (0.0, 0.32, np.nan):
        with pytest.raises(ScenarioError, match=r"torso of pr2 must be from 0.0115 to 0.305 m"):
            arm.check_height(z)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('lower="-2.0" upper="2.0" ', "", "joint turret_joint has no limits"),
        ('name="tip"', 'name="end"', "tip"),
        ('type="revolute"', 'type="prismatic"', "joint turret_joint is not revolute"),
        ("drake:controller_gains", "drake:other", "joint turret_joint needs an actuator with"),
        (
            "<drake:capsule",
            "<drake:ellipsoid a='1' b='1' c='1'",
            "skin must be capsules, boxes,",
        ),
        ("</robot>", "", "."),
    ],
)
def test_models_that_are_no_arm_are_refused(old: str, new: str, said: str) -> None:
    with pytest.raises(ScenarioError, match=rf"model of mine does not describe(?s:.)*{said}") as e:
        Arm("mine", describe().replace(old, new))
    assert "\n" not in str(e.value)


def test_limits_can_be_narrowed_and_joints_held() -> None:
    arm = Arm("mine", describe(), q_max=np.full(4, 0.5), held={"hand_joint": 0.3})
    np.testing.assert_allclose(arm.q_max, 0.5)
    q = np.array([0.1, -0.2, 0.3, 0.4])
    whole = FIVE.calc_pose(np.append(q, 0.3))
    np.testing.assert_allclose(arm.calc_pose(q).p_RE, whole.p_RE, atol=1e-12)


@pytest.mark.parametrize("kind", ["box", "cylinder"])
@given(*(st.tuples(*[st.floats(low, high)] * 3) for low, high in ((0.005, 0.5), (-3.0, 3.0))))
def test_the_capsule_of_a_shape_touches_its_edges(
    kind: str, edges: tuple[float, ...], rpy: tuple[float, ...]
) -> None:
    R_LS = RollPitchYaw(rpy).ToRotationMatrix().matrix()
    size = edges if kind == "box" else edges[:2]
    shape = SkinShape(link="link", kind=kind, size=size, R_LS=R_LS, p_LS=np.array([0.1, -0.2, 0.3]))
    p_SQ = 0.5 * np.array(np.meshgrid(*[(-1.0, 1.0)] * 3)).reshape(3, -1).T * edges
    if kind == "cylinder":
        angle, height = np.meshgrid(np.linspace(0.0, 6.0, 7), [-0.5 * size[1], 0.5 * size[1]])
        rims = np.stack([size[0] * np.cos(angle), size[0] * np.sin(angle), height], axis=-1)
        p_SQ = rims.reshape(-1, 3)
    capsule = shape.enclosing_capsule()
    p_CQ = (shape.p_LS + p_SQ @ R_LS.T - capsule.p_LS) @ capsule.R_LS
    p_CQ[:, 2] -= np.clip(p_CQ[:, 2], -0.5 * capsule.size[1], 0.5 * capsule.size[1])
    np.testing.assert_allclose(np.linalg.norm(p_CQ, axis=1), capsule.size[0], atol=1e-12)
    if kind == "box":  # Its axis is the longest edge.
        assert capsule.size[1] == max(edges)
