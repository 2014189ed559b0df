import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydrake.geometry import SceneGraph
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import FixedOffsetFrame, JacobianWrtVariable
from pydrake.systems.framework import Context

from lic_drake.paths import models_dir
from lic_drake.robots.planar import planar_arm
from lic_drake.robots.planar_kinematics import wrap_angle

ARM = planar_arm()
ANGLES = st.tuples(*(st.floats(low, high) for low, high in zip(ARM.q_min, ARM.q_max, strict=True)))


def make_plant() -> MultibodyPlant:
    plant = MultibodyPlant(time_step=0.0)
    scene_graph = SceneGraph()
    plant.RegisterAsSourceForSceneGraph(scene_graph)
    Parser(plant).AddModels(str(models_dir() / "planar_arm.urdf"))
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("base"))
    plant.mutable_gravity_field().set_gravity_vector(np.zeros(3))
    plant.Finalize()
    return plant


PLANT = make_plant()
CONTEXT = PLANT.CreateDefaultContext()


def at(angles: tuple[float, ...]) -> tuple[np.ndarray, Context]:
    q = np.array(angles)
    PLANT.SetPositions(CONTEXT, q)
    return q, CONTEXT


def test_the_base_is_welded_to_the_world_or_to_the_frame_that_is_given() -> None:
    X_WF = RigidTransform(RollPitchYaw(0.0, 0.0, 0.7), np.array([0.3, -0.2, 0.1]))
    for X_WR in (RigidTransform(), X_WF):
        plant = MultibodyPlant(time_step=1e-3)
        frame = plant.AddFrame(FixedOffsetFrame("mount", plant.world_frame(), X_WR))
        arm = ARM.add_to_plant(plant, frame) if X_WR is X_WF else ARM.add_to_plant(plant)
        plant.Finalize()
        context = plant.CreateDefaultContext()
        q = np.array([0.3, 0.4, 0.5])
        plant.SetPositions(context, arm, q)
        p_WE = plant.GetFrameByName("tip", arm).CalcPoseInWorld(context).translation()
        np.testing.assert_allclose(p_WE, X_WR @ ARM.tip_position(q), atol=1e-12)


def test_limits_gains_and_reach_are_those_of_the_testbed() -> None:
    np.testing.assert_allclose(np.rad2deg(ARM.q_min), [-150.0, -63.0, 0.0], atol=1e-6)
    np.testing.assert_allclose(np.rad2deg(ARM.q_max), [150.0, 162.0, 159.0], atol=1e-6)
    np.testing.assert_array_equal(ARM.stiffness, [30.0, 20.0, 15.0])
    np.testing.assert_array_equal(ARM.damping, [15.0, 10.0, 8.0])
    np.testing.assert_allclose(ARM.kinematics.link_lengths, [0.196, 0.334, 0.288], atol=1e-12)
    assert ARM.reach_m == pytest.approx(0.818)


@pytest.mark.parametrize(
    ("link", "mass", "com", "inertia"),
    [
        ("link1", 2.835, 0.098, 0.011214),
        ("link2", 2.3, 0.167, 0.024175),
        ("link3", 1.32, 0.1365, 0.009533),
    ],
)
def test_masses_centres_of_mass_and_inertias_are_those_of_the_testbed(
    link: str, mass: float, com: float, inertia: float
) -> None:
    body = PLANT.GetBodyByName(link)
    assert body.default_mass() == pytest.approx(mass)
    np.testing.assert_allclose(body.default_com(), [0.0, -com, 0.0], atol=1e-12)
    about_com = body.default_spatial_inertia().Shift(body.default_com())
    moment = about_com.CalcRotationalInertia().get_moments()[2]
    assert moment == pytest.approx(inertia, rel=1e-6)


def test_the_inertias_are_those_of_solid_capsules() -> None:
    for capsule in ARM.skin:
        body = PLANT.GetBodyByName(capsule.link)
        r, length, mass = capsule.radius, capsule.length, body.default_mass()
        # Cylinder and two half balls of equal density, the balls by the parallel-axis theorem.
        cylinder = mass * length / (length + 4.0 / 3.0 * r)
        balls = mass - cylinder
        offset = 0.5 * length + 3.0 / 8.0 * r
        expected = cylinder * (length**2 / 12.0 + r**2 / 4.0)
        expected += balls * (83.0 / 320.0 * r**2 + offset**2)
        about_com = body.default_spatial_inertia().Shift(body.default_com())
        assert about_com.CalcRotationalInertia().get_moments()[2] == pytest.approx(
            expected, rel=2e-3
        )


def test_the_straight_arm_points_along_minus_y() -> None:
    q, context = at((0.0, 0.0, 0.0))
    X_WE = PLANT.GetFrameByName("tip").CalcPoseInWorld(context)
    np.testing.assert_allclose(X_WE.translation(), [0.0, -0.818, 0.0], atol=1e-12)
    np.testing.assert_allclose(ARM.tip_position(q), [0.0, -0.818, 0.0], atol=1e-12)


def test_the_apex_of_the_last_cap_is_the_tip() -> None:
    last = ARM.skin[-1]
    along = last.R_LC[:, 2]
    apexes = last.p_LC + np.outer([1.0, -1.0], (0.5 * last.length + last.radius) * along)
    np.testing.assert_allclose(sorted(apexes[:, 1]), [-0.288, 0.015], atol=1e-12)


@given(ANGLES)
def test_the_hand_pose_agrees_with_drake(angles: tuple[float, ...]) -> None:
    q, context = at(angles)
    X_WE = PLANT.GetFrameByName("tip").CalcPoseInWorld(context)
    np.testing.assert_allclose(ARM.tip_position(q), X_WE.translation(), atol=1e-12)
    x, y, phi = ARM.tip_pose(q)
    np.testing.assert_allclose([x, y], X_WE.translation()[:2], atol=1e-12)
    direction = X_WE.rotation().matrix()[:, 0]
    np.testing.assert_allclose([np.cos(phi), np.sin(phi), 0.0], direction, atol=1e-12)


@given(ANGLES)
def test_the_tip_jacobian_agrees_with_drake(angles: tuple[float, ...]) -> None:
    q, context = at(angles)
    expected = PLANT.CalcJacobianTranslationalVelocity(
        context,
        JacobianWrtVariable.kV,
        PLANT.GetFrameByName("tip"),
        np.zeros(3),
        PLANT.world_frame(),
        PLANT.world_frame(),
    )
    np.testing.assert_allclose(ARM.tip_jacobian(q), expected, atol=1e-12)


@given(ANGLES)
def test_the_link_poses_agree_with_drake(angles: tuple[float, ...]) -> None:
    q, context = at(angles)
    for R_RL, p_RL, name in zip(*ARM.link_poses(q), ARM.link_names, strict=True):
        X_WL = PLANT.GetBodyByName(name).EvalPoseInWorld(context)
        np.testing.assert_allclose(R_RL, X_WL.rotation().matrix(), atol=1e-12)
        np.testing.assert_allclose(p_RL, X_WL.translation(), atol=1e-12)


@given(ANGLES, ANGLES)
def test_answers_do_not_depend_on_what_was_asked_before(
    angles: tuple[float, ...], others: tuple[float, ...]
) -> None:
    q, other = np.array(angles), np.array(others)
    questions = (ARM.tip_position, ARM.tip_jacobian, lambda q: ARM.link_poses(q)[0])
    first = [np.array(question(q)) for question in questions]
    for question, answer in zip(questions, first, strict=True):
        question(other)
        np.testing.assert_array_equal(question(q), answer)


def test_shared_answers_cannot_be_written_to() -> None:
    q = np.array([0.1, 0.2, 0.3])
    for answer in (ARM.tip_position(q), ARM.tip_jacobian(q), *ARM.link_poses(q)):
        with pytest.raises(ValueError, match="read-only"):
            answer[0] = 1.0


POINTS = st.lists(
    st.tuples(st.integers(0, 2), st.floats(-0.1, 0.1), st.floats(-0.4, 0.1)), max_size=5
)


@given(ANGLES, POINTS)
def test_point_jacobians_agree_with_drake_and_with_the_closed_form(
    angles: tuple[float, ...], points: list[tuple[int, float, float]]
) -> None:
    q, context = at(angles)
    links = np.array([link for link, _, _ in points], dtype=int)
    p_LQ = np.array([[x, y, 0.0] for _, x, y in points]).reshape(-1, 3)
    poses = [PLANT.GetBodyByName(ARM.link_names[link]).EvalPoseInWorld(context) for link in links]
    p_RQ = np.array([X @ p for X, p in zip(poses, p_LQ, strict=True)]).reshape(-1, 3)
    jacobians = ARM.point_jacobians(q, links, p_RQ)
    assert jacobians.shape == (len(points), 3, 3)
    for link, p_L, p_R, jacobian in zip(links, p_LQ, p_RQ, jacobians, strict=True):
        expected = PLANT.CalcJacobianTranslationalVelocity(
            context,
            JacobianWrtVariable.kV,
            PLANT.GetBodyByName(ARM.link_names[link]).body_frame(),
            p_L,
            PLANT.world_frame(),
            PLANT.world_frame(),
        )
        np.testing.assert_allclose(jacobian, expected, atol=1e-12)
        np.testing.assert_allclose(
            jacobian[:2], ARM.kinematics.point_jacobian(q, link, p_R[:2]), atol=1e-15
        )


def test_a_start_pose_brings_drakes_tip_frame_to_it() -> None:
    x0 = np.array([0.335, -0.2, np.deg2rad(30.0)])
    solution = ARM.solve_ik(x0)
    assert solution is not None
    _, context = at(tuple(solution))
    X_WE = PLANT.GetFrameByName("tip").CalcPoseInWorld(context)
    expected = RigidTransform(p=[0.335, -0.2, 0.0])
    np.testing.assert_allclose(X_WE.translation(), expected.translation(), atol=1e-9)
    assert wrap_angle(ARM.tip_pose(solution)[2] - x0[2]) == pytest.approx(0.0, abs=1e-9)


def test_the_arm_ignores_contacts_between_its_own_links() -> None:
    plant = MultibodyPlant(time_step=1e-3)
    scene_graph = SceneGraph()
    plant.RegisterAsSourceForSceneGraph(scene_graph)
    ARM.add_to_plant(plant)
    plant.Finalize()
    assert scene_graph.model_inspector().GetCollisionCandidates() == set()


def test_gravity_does_not_pull_at_the_arm() -> None:
    plant = MultibodyPlant(time_step=1e-3)
    arm = ARM.add_to_plant(plant)
    plant.mutable_gravity_field().set_gravity_vector([9.81, 0.0, 0.0])
    plant.Finalize()
    context = plant.CreateDefaultContext()
    assert not plant.is_gravity_enabled(arm)
    np.testing.assert_array_equal(plant.CalcGravityGeneralizedForces(context), 0.0)
