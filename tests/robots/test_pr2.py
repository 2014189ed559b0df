import time

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydrake.geometry import SceneGraph
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.plant import (
    AddMultibodyPlantSceneGraph,
    ExternallyAppliedSpatialForce,
    MultibodyPlant,
)
from pydrake.multibody.tree import FixedOffsetFrame
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig
from pydrake.systems.framework import Context, Diagram, DiagramBuilder
from support.pr2_reference import FACTS, link_poses, mass_matrix

from lic_drake.errors import ScenarioError
from lic_drake.robots.arm import Arm
from lic_drake.robots.pr2 import Pr2Arm, pr2_arm
from lic_drake.robots.pr2_description import LEFT_ARM_AT_REST, joint_names, read_pr2
from lic_drake.robots.pr2_inverse import calc_preselection_cost, solve_pose
from lic_drake.robots.registry import get_robot

STAND = ((0.3, -0.2, 0.5), 0.15)
ARM = Pr2Arm(*STAND)
ANGLES = st.tuples(*(st.floats(low, high) for low, high in zip(ARM.q_min, ARM.q_max, strict=True)))


class World:
    """The robot alone, in a diagram."""

    def __init__(self, arm: Pr2Arm, time_step: float = 5e-3) -> None:
        builder = DiagramBuilder()
        self.plant: MultibodyPlant
        self.scene_graph: SceneGraph
        self.plant, self.scene_graph = AddMultibodyPlantSceneGraph(builder, time_step)
        self.pr2 = arm.add_to_plant(self.plant)
        self.plant.Finalize()
        self.diagram: Diagram = builder.Build()
        self.root: Context = self.diagram.CreateDefaultContext()
        self.context: Context = self.plant.GetMyMutableContextFromRoot(self.root)

    def touching(self, q: np.ndarray) -> set[frozenset[str]]:
        """Names of the bodies that touch each other at a configuration."""
        self.plant.SetPositions(self.context, self.pr2, q)
        query = self.scene_graph.get_query_output_port().Eval(
            self.scene_graph.GetMyContextFromRoot(self.root)
        )
        bodies = [
            self.plant.GetBodyFromFrameId(query.inspector().GetFrameId(geometry)).name()
            for pair in query.ComputePointPairPenetration()
            for geometry in (pair.id_A, pair.id_B)
        ]
        return {frozenset(pair) for pair in zip(bodies[::2], bodies[1::2], strict=True)}

    def settle(self, q: np.ndarray, q_d: np.ndarray, f_E_W: np.ndarray, seconds: float) -> None:
        """Simulates the arm from rest, with a force at the tool frame."""
        push = ExternallyAppliedSpatialForce()
        push.body_index = self.plant.GetBodyByName("r_wrist_roll_link").index()
        push.p_BoBq_B = np.array([0.18, 0.0, 0.0])
        push.F_Bq_W = SpatialForce(np.zeros(3), f_E_W)
        self.plant.get_applied_spatial_force_input_port().FixValue(self.context, [push])
        desired = np.concatenate([q_d, np.zeros(7)])
        self.plant.get_desired_state_input_port(self.pr2).FixValue(self.context, desired)
        self.plant.SetPositionsAndVelocities(
            self.context, self.pr2, np.concatenate([q, np.zeros(7)])
        )
        self.root.SetTime(0.0)
        simulator = Simulator(self.diagram, self.root)
        if self.plant.time_step() == 0.0:
            ApplySimulatorConfig(
                SimulatorConfig(integration_scheme="cenic", accuracy=1e-4, max_step_size=0.01),
                simulator,
            )
        simulator.AdvanceTo(seconds)

    def positions(self) -> np.ndarray:
        return np.array(self.plant.GetPositions(self.context, self.pr2))


WORLD = World(ARM)


def test_the_arm_is_an_arm_as_the_other_rooms_want_it() -> None:
    arm: Arm = pr2_arm()
    assert get_robot("pr2") is pr2_arm() is arm
    assert arm.name == "pr2"
    assert arm.link_names[0] == "r_shoulder_pan_link"
    assert arm.link_names[-1] == "r_wrist_roll_link"
    assert len(arm.q_min) == len(arm.q_max) == len(arm.stiffness) == 7


def test_the_joint_limits_are_the_controllers_within_the_robots() -> None:
    np.testing.assert_allclose(
        np.rad2deg(ARM.q_min), [-109.0, -24.0, -220.0, -132.0, -270.0, -119.977, -180.0], atol=1e-3
    )
    np.testing.assert_allclose(
        np.rad2deg(ARM.q_max), [26.0, 68.0, 41.0, 0.0, 270.0, 0.0, 180.0], atol=1e-9
    )
    assert np.all(ARM.q_min >= read_pr2().q_min)
    assert np.all(ARM.q_max <= read_pr2().q_max)
    assert np.all(ARM.q_home > np.maximum(ARM.q_min, ARM.q_soft_min))
    assert np.all(ARM.q_home < np.minimum(ARM.q_max, ARM.q_soft_max))


@given(ANGLES)
def test_the_plant_has_the_links_where_the_published_numbers_put_them(
    angles: tuple[float, ...],
) -> None:
    q = np.array(angles)
    WORLD.plant.SetPositions(WORLD.context, WORLD.pr2, q)
    frames = [*ARM.link_names, "r_gripper_tool_frame"]
    for name, expected in zip(frames, link_poses(*STAND, q), strict=True):
        X_WF = WORLD.plant.GetFrameByName(name).CalcPoseInWorld(WORLD.context)
        np.testing.assert_allclose(X_WF.GetAsMatrix4(), expected, atol=1e-12)


@given(ANGLES)
def test_the_mass_matrix_is_that_of_the_published_numbers(angles: tuple[float, ...]) -> None:
    q = np.array(angles)
    WORLD.plant.SetPositions(WORLD.context, WORLD.pr2, q)
    M = WORLD.plant.CalcMassMatrix(WORLD.context)
    np.testing.assert_allclose(M, mass_matrix(q), atol=1e-8)


@given(ANGLES)
def test_a_hand_pose_has_a_configuration_and_the_configuration_that_pose(
    angles: tuple[float, ...],
) -> None:
    x0 = ARM.tip_pose(np.array(angles))
    X_RE = link_poses(*STAND, np.array(angles))[7]
    assert x0[3] >= 0.0
    np.testing.assert_allclose(x0[:3], X_RE[:3, 3], atol=1e-12)
    # Within the limits, but perhaps between two of the pan angles that are tried.
    q = ARM.solve_ik(x0)
    if q is not None:
        assert np.all(q >= ARM.q_min)
        assert np.all(q <= ARM.q_max)
        np.testing.assert_allclose(link_poses(*STAND, q)[7], X_RE, atol=1e-7)


def test_the_configuration_of_a_pose_is_the_one_of_least_cost() -> None:
    x0 = ARM.tip_pose(ARM.q_home)
    q = ARM.solve_ik(3.0 * x0 - 2.0 * np.concatenate([x0[:3], np.zeros(4)]))
    assert q is not None
    everything = solve_pose(ARM.kinematics, x0[:3], ARM.tip_rotation(ARM.q_home))
    cost = calc_preselection_cost(ARM.kinematics, everything)
    assert calc_preselection_cost(ARM.kinematics, q[None])[0] == pytest.approx(cost.min())
    assert ARM.solve_ik(x0 + [5.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]) is None


def test_adding_the_robot_takes_less_than_a_second() -> None:
    begin = time.perf_counter()
    World(ARM)
    assert time.perf_counter() - begin < 1.0


@pytest.mark.parametrize("torso_m", [0.0, 0.32, np.nan])
def test_a_torso_beyond_its_range_is_refused(torso_m: float) -> None:
    with pytest.raises(ScenarioError, match="torso_m must be from"):
        Pr2Arm(torso_m=torso_m)


def test_the_robot_can_be_added_to_a_frame_that_is_not_the_worlds() -> None:
    plant = MultibodyPlant(time_step=1e-3)
    X_WP = RigidTransform(RollPitchYaw(0.0, 0.0, 1.0), [1.0, 2.0, 3.0])
    frame = plant.AddFrame(FixedOffsetFrame("stand", plant.world_frame(), X_WP))
    ARM.add_to_plant(plant, frame)
    plant.Finalize()
    context = plant.CreateDefaultContext()
    plant.SetPositions(context, ARM.q_home)
    X_WE = plant.GetFrameByName("r_gripper_tool_frame").CalcPoseInWorld(context)
    np.testing.assert_allclose(X_WE.translation(), X_WP @ ARM.tip_position(ARM.q_home), atol=1e-12)


def test_a_mobile_robot_stands_where_a_welded_one_does_and_can_move() -> None:
    plant = MultibodyPlant(time_step=1e-3)
    pr2 = Pr2Arm(*STAND, mobile=True).add_to_plant(plant)
    plant.Finalize()
    context = plant.CreateDefaultContext()
    assert plant.num_positions(pr2) == 11
    np.testing.assert_allclose(plant.GetPositions(context)[:4], [*STAND[0], STAND[1]])
    tool = plant.GetFrameByName("r_gripper_tool_frame")
    zero = np.zeros(7)
    np.testing.assert_allclose(
        tool.CalcPoseInWorld(context).translation(), ARM.tip_position(zero), atol=1e-12
    )
    moved = Pr2Arm((-0.1, 0.2, -0.5), 0.3)
    plant.SetPositions(context, np.concatenate([moved.base_pose, [0.3], zero]))
    np.testing.assert_allclose(
        tool.CalcPoseInWorld(context).translation(), moved.tip_position(zero), atol=1e-12
    )


def test_the_left_arm_hangs_beside_the_body() -> None:
    plant, context = WORLD.plant, WORLD.plant.CreateDefaultContext()
    X_WF = plant.GetFrameByName("base_footprint").CalcPoseInWorld(context)
    hand = plant.GetFrameByName("l_gripper_tool_frame").CalcPoseInWorld(context)
    p_FE = X_WF.inverse() @ hand.translation()
    assert p_FE[0] < 0.35  # Not before the base, whose front is at 0.32 m.
    assert p_FE[1] > 0.3
    assert len(LEFT_ARM_AT_REST) == len(joint_names("l"))


def test_gravity_does_not_pull_at_the_arm() -> None:
    assert not WORLD.plant.is_gravity_enabled(WORLD.pr2)
    assert np.any(WORLD.plant.gravity_field().gravity_vector() != 0.0)
    WORLD.plant.SetPositions(WORLD.context, WORLD.pr2, ARM.q_home)
    np.testing.assert_array_equal(WORLD.plant.CalcGravityGeneralizedForces(WORLD.context), 0.0)


def test_nothing_touches_at_home_or_in_the_middle_of_the_limits() -> None:
    for torso_m in (0.0115, 0.15, 0.305):
        world = World(Pr2Arm(torso_m=torso_m))
        assert world.touching(ARM.q_home) == set()
        assert world.touching(0.5 * (ARM.q_min + ARM.q_max)) == set()


def test_only_forearm_and_hand_ever_touch_the_rest_of_the_robot() -> None:
    rng = np.random.default_rng(0)
    far = {f"r_{name}_link" for name in ("elbow_flex", "forearm_roll", "wrist_flex", "wrist_roll")}
    hard_min = np.maximum(read_pr2().q_min, -np.pi * np.array([2, 2, 2, 2, 1, 2, 1]))
    hard_max = np.minimum(read_pr2().q_max, np.pi)
    count, num_touching = 0, 0
    for torso_m in rng.uniform(0.0115, 0.305, 10):
        world = World(Pr2Arm(torso_m=torso_m))
        for _ in range(60):
            pairs = world.touching(rng.uniform(hard_min, hard_max))
            for pair in pairs:
                assert len(pair & far) == 1, sorted(pair)
            count += 1
            # The published share counts the right arm's own body, not the left arm.
            num_touching += any(not name.startswith("l_") for pair in pairs for name in pair - far)
    assert 100.0 * num_touching / count == pytest.approx(FACTS["self_collision_pct"], abs=4.0)


@pytest.mark.parametrize("time_step", [0.0, 5e-3])
def test_the_arm_yields_to_a_push_like_springs_of_its_stiffness(time_step: float) -> None:
    world = World(ARM, time_step)
    for f_E_W in 3.0 * np.eye(3):
        world.settle(ARM.q_home, ARM.q_home, f_E_W, seconds=4.0)
        q = world.positions()
        torque = ARM.tip_jacobian(q).T @ f_E_W
        assert np.max(np.abs(torque)) > 0.2
        np.testing.assert_allclose(ARM.stiffness * (q - ARM.q_home), torque, atol=2e-3)


def test_a_continuous_joint_goes_on_beyond_half_a_turn() -> None:
    q, q_d = ARM.q_home.copy(), ARM.q_home.copy()
    q[[4, 6]], q_d[[4, 6]] = [3.0, -3.0], [3.4, -3.4]
    WORLD.settle(q, q_d, np.zeros(3), seconds=2.0)
    np.testing.assert_allclose(WORLD.positions(), q_d, atol=1e-3)


def test_motors_give_no_more_than_their_effort() -> None:
    # A target ten radians away would ask for 800 Nm of the lift; with 30 Nm it begins slowly.
    q_d = ARM.q_home.copy()
    q_d[1] += 10.0
    WORLD.settle(ARM.q_home, q_d, np.zeros(3), seconds=0.005)
    torque = WORLD.plant.get_net_actuation_output_port().Eval(WORLD.context)
    np.testing.assert_allclose(torque[1], 30.0, atol=1e-9)


def test_every_link_wears_a_capsule_around_each_of_its_shapes() -> None:
    assert {capsule.link for capsule in ARM.skin} == set(ARM.link_names)
    for capsule, shape in zip(ARM.skin, ARM.surface, strict=True):
        assert capsule.link == shape.link
        np.testing.assert_array_equal(capsule.p_LC, shape.p_LS)
        assert capsule.length + 2.0 * capsule.radius >= max(shape.size)
