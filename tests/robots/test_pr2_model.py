from itertools import pairwise

import numpy as np
import pytest
from pydrake.geometry import Box, Cylinder, SceneGraph
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import ModelInstanceIndex
from support.pr2_reference import FACTS

from lic_drake.errors import ScenarioError
from lic_drake.paths import models_dir
from lic_drake.robots.pr2 import (
    CARRIAGE,
    HEAD_CAMERA,
    JOINTS,
    LEFT_ARM_AT_REST,
    RIGHT_ARM_AT_REST,
    TORSO_RANGE_M,
    make_pr2,
    pr2_arm,
)


def joint_names(side: str = "r") -> tuple[str, ...]:
    return tuple(f"{side}_{joint}_joint" for joint in JOINTS)


def link_names(side: str = "r") -> tuple[str, ...]:
    return tuple(f"{side}_{joint}_link" for joint in JOINTS)


RIGHT = [FACTS["joints"][name] for name in joint_names()]


def make_plant() -> tuple[MultibodyPlant, SceneGraph, ModelInstanceIndex]:
    """The model file with all its joints."""
    plant, scene_graph = MultibodyPlant(time_step=1e-3), SceneGraph()
    plant.RegisterAsSourceForSceneGraph(scene_graph)
    (pr2,) = Parser(plant).AddModels(str(models_dir() / "pr2" / "pr2.urdf"))
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("base_link_for_rbt_compat"))
    plant.Finalize()
    return plant, scene_graph, pr2


PLANT, SCENE_GRAPH, PR2 = make_plant()


def or_infinite(values: list[float | None], sign: float) -> np.ndarray:
    return np.array([sign * np.inf if value is None else value for value in values])


@pytest.mark.parametrize("name", FACTS["joints"])
def test_every_joint_has_the_published_limits_damping_and_place(name: str) -> None:
    joint, facts = PLANT.GetJointByName(name), FACTS["joints"][name]
    lower, upper = or_infinite([facts["lower"]], -1.0), or_infinite([facts["upper"]], 1.0)
    np.testing.assert_array_equal(joint.position_lower_limits(), lower)
    np.testing.assert_array_equal(joint.position_upper_limits(), upper)
    velocity = or_infinite([facts["velocity_limit"]], 1.0)
    np.testing.assert_array_equal(joint.velocity_upper_limits(), velocity)
    np.testing.assert_array_equal(joint.default_damping_vector(), [facts["damping"]])
    context = PLANT.CreateDefaultContext()
    parent = PLANT.GetFrameByName(facts["parent"], PR2)
    X_PJ = joint.frame_on_parent().CalcPose(context, parent)
    expected = RigidTransform(RollPitchYaw(facts["rpy_rad"]), facts["xyz_m"])
    assert X_PJ.IsNearlyEqualTo(expected, 1e-12)
    axis = joint.translation_axis() if facts["type"] == "prismatic" else joint.revolute_axis()
    np.testing.assert_array_equal(axis, facts["axis"])


def test_the_right_arm_has_the_published_efforts_and_the_simulated_controllers_gains() -> None:
    actuators = [PLANT.GetJointActuatorByName(name) for name in joint_names()]
    efforts = [actuator.effort_limit() for actuator in actuators]
    np.testing.assert_array_equal(efforts, [joint["effort_limit"] for joint in RIGHT])
    # pr2sim_arm_controllers of gt-ros-pkg/hrl (hrl_gazebo_plugin).
    arm = pr2_arm()
    np.testing.assert_array_equal(arm.stiffness, [90.0, 80.0, 20.0, 22.0, 20.0, 27.5, 20.0])
    np.testing.assert_array_equal(arm.damping, [10.0, 10.0, 2.0, 1.0, 1.0, 2.0, 2.0])
    assert PLANT.num_actuators() == 7


def test_postures_and_torso_are_within_the_soft_limits() -> None:
    torso = FACTS["joints"]["torso_lift_joint"]
    assert TORSO_RANGE_M == (torso["soft_lower"], torso["soft_upper"])
    for side, rest in (("l", np.array(LEFT_ARM_AT_REST)), ("r", RIGHT_ARM_AT_REST)):
        joints = [FACTS["joints"][name] for name in joint_names(side)]
        assert np.all(rest >= or_infinite([joint["soft_lower"] for joint in joints], -1.0))
        assert np.all(rest <= or_infinite([joint["soft_upper"] for joint in joints], 1.0))


@pytest.mark.parametrize("name", FACTS["moving_bodies"])
def test_every_body_has_the_published_mass_and_inertia(name: str) -> None:
    facts = FACTS["moving_bodies"][name]
    body = PLANT.GetBodyByName("head" if name == "head" else facts["frame"])
    assert body.default_mass() == pytest.approx(facts["mass_kg"], rel=1e-12)
    np.testing.assert_allclose(body.default_com(), facts["com_m"], atol=1e-12)
    about_com = body.default_spatial_inertia().Shift(body.default_com()).CalcRotationalInertia()
    inertia = facts["inertia_kgm2"]
    moments = [inertia[key] for key in ("ixx", "iyy", "izz")]
    products = [inertia[key] for key in ("ixy", "ixz", "iyz")]
    np.testing.assert_allclose(about_com.get_moments(), moments, atol=1e-9)
    np.testing.assert_allclose(about_com.get_products(), products, atol=1e-9)
    mass = PLANT.CalcTotalMass(PLANT.CreateDefaultContext())
    assert mass == pytest.approx(FACTS["whole_robot_kg"], abs=1e-6)


def body_names(moving_body: str) -> list[str]:
    if moving_body in ("base", "torso"):
        return [FACTS["moving_bodies"][moving_body]["frame"]]
    return [f"{side}_{moving_body}_link" for side in "rl"]


def shapes_of(body: str) -> list[tuple[object, ...]]:
    """Sizes and poses of a body's collision shapes, to the micrometre, in any order."""
    inspector, shapes = SCENE_GRAPH.model_inspector(), []
    for geometry in PLANT.GetCollisionGeometriesForBody(PLANT.GetBodyByName(body)):
        shape, X_LS = inspector.GetShape(geometry), inspector.GetPoseInFrame(geometry)
        if isinstance(shape, Box):
            size = shape.size().tolist()
        else:
            assert isinstance(shape, Cylinder)
            size = [shape.radius(), shape.length()]
        shapes.append(as_shape(size, X_LS))
    return sorted(shapes)


def as_shape(size: list[float], X_LS: RigidTransform) -> tuple[object, ...]:
    matrix = np.round(X_LS.GetAsMatrix34(), 5) + 0.0
    return (len(size), *np.round(size, 6).tolist(), *matrix.ravel().tolist())


def test_the_collision_shapes_are_the_fitted_ones_on_both_arms_and_the_body() -> None:
    expected: dict[str, list[tuple[object, ...]]] = {}
    for entry in FACTS["collision"]:
        for primitive in entry["primitives"]:
            X_LS = RigidTransform(RollPitchYaw(primitive["rpy_rad"]), primitive["xyz_m"])
            size = primitive.get("size_m") or [primitive["radius_m"], primitive["length_m"]]
            for name in body_names(entry["body"]):
                expected.setdefault(name, []).append(as_shape(size, X_LS))
    found = {name: shapes_of(name) for name in expected}
    # The model keeps the shapes of the head, which the facts count to the torso, on its own link.
    found["torso_lift_link"] = sorted(found["torso_lift_link"] + shapes_of("head"))
    assert found == {name: sorted(shapes) for name, shapes in expected.items()}
    assert len(pr2_arm().skin) == sum(len(expected[name]) for name in link_names())


def test_pairs_that_touch_by_design_and_neighbours_are_filtered() -> None:
    inspector = SCENE_GRAPH.model_inspector()
    candidates = {
        frozenset(PLANT.GetBodyFromFrameId(inspector.GetFrameId(g)).name() for g in pair)
        for pair in inspector.GetCollisionCandidates()
    }
    for side in "rl":
        names = {
            name: f"{side}_{name}_link" for pair in FACTS["filtered_pairs"] for name in pair
        } | {"torso": "torso_lift_link", "base": "base_link"}
        for one, other in FACTS["filtered_pairs"]:
            assert frozenset((names[one], names[other])) not in candidates
        chain = ["torso_lift_link", *link_names(side)]
        for one, other in pairwise(chain):
            assert frozenset((one, other)) not in candidates
        assert frozenset(("base_link", f"{side}_wrist_roll_link")) in candidates
    assert frozenset(("r_forearm_roll_link", "r_shoulder_pan_link")) in candidates


def test_held_joints_are_where_the_joints_would_be() -> None:
    heading, height = 2.0, 0.2
    held = MultibodyPlant(time_step=1e-3)
    arm = make_pr2(heading)
    model = arm.add_to_plant(held, mobile=True)
    held.Finalize()
    assert held.num_positions() == 3 + 7
    fixed, context = held.CreateDefaultContext(), PLANT.CreateDefaultContext()
    held.SetPositions(fixed, model, arm.positions(np.array([0.4, -0.3, height]), np.zeros(7)))
    positions = dict(zip((*CARRIAGE, "theta"), (0.4, -0.3, height, heading), strict=True))
    positions |= dict(zip(joint_names("l"), LEFT_ARM_AT_REST, strict=True))
    q = np.zeros(PLANT.num_positions())
    for name, position in positions.items():
        q[PLANT.GetJointByName(name).position_start()] = position
    PLANT.SetPositions(context, q)
    for name in ("base_link", "torso_lift_link", "l_wrist_roll_link", "r_gripper_tool_frame"):
        X_WF = PLANT.GetFrameByName(name).CalcPoseInWorld(context)
        assert held.GetFrameByName(name).CalcPoseInWorld(fixed).IsNearlyEqualTo(X_WF, 1e-12)


@pytest.mark.parametrize("tilt_deg", [0.0, -15.0, 60.0])
def test_a_tilted_head_turns_its_camera_about_the_tilt_axis(tilt_deg: float) -> None:
    # In R torso_lift_link is 0.05 m behind the base's centre, 0.790675 m above the floor.
    p_RT = np.array([-0.05, 0.0, 0.790675])
    p_RA, p_RC = p_RT + [0.05093, 0.0, 0.38145], p_RT + [0.128, 0.0, 0.478]
    turn = RotationMatrix.MakeYRotation(np.deg2rad(tilt_deg)).matrix()
    plant = MultibodyPlant(time_step=1e-3)
    make_pr2(head_tilt_deg=tilt_deg).add_to_plant(plant)
    plant.Finalize()
    X_RC = plant.GetFrameByName(HEAD_CAMERA).CalcPoseInWorld(plant.CreateDefaultContext())
    # Level, it looks along x with the image upright; down is positive.
    level = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
    np.testing.assert_allclose(X_RC.rotation().matrix(), turn @ level, atol=1e-9)
    np.testing.assert_allclose(X_RC.translation(), p_RA + turn @ (p_RC - p_RA), atol=1e-9)
    with pytest.raises(ScenarioError, match=r"head_tilt_deg must be from -21.27 to 74.27"):
        make_pr2(head_tilt_deg=75.0)
