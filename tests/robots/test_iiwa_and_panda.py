"""The iiwa 14 and the Panda against published numbers, by code that does not read the models."""

import json
from pathlib import Path

import numpy as np
import pytest
from pydrake.multibody.plant import MultibodyPlant
from scipy.spatial.transform import Rotation

from lic_drake.robots.arm import Arm
from lic_drake.robots.registry import get_robot

FACTS = json.loads((Path(__file__).parents[1] / "data" / "arm_facts.json").read_text())
ROD_M = {"iiwa14": 0.25, "panda": 0.325}
MOUNT = {"iiwa14": (-0.2, -0.188, 0.43), "panda": (-0.2, -0.188, 0.457)}
each_arm = pytest.mark.parametrize("name", ROD_M)


def turn(axis: str, angle: float) -> np.ndarray:
    T = np.eye(4)
    T[:3, :3] = Rotation.from_euler(axis, angle).as_matrix()
    return T


def shift(x: float, z: float) -> np.ndarray:
    T = np.eye(4)
    T[[0, 2], 3] = x, z
    return T


def flange(name: str, q: np.ndarray) -> np.ndarray:
    """The flange in the arm's base, shape (4, 4), by Denavit and Hartenberg."""
    facts, T = FACTS[name]["dh"], np.eye(4)
    for row, angle in zip(facts["rows"], [*q, 0.0], strict=False):
        if facts["convention"] == "distal":
            d, alpha, a = row
            T = T @ turn("z", angle) @ shift(a, d) @ turn("x", np.deg2rad(alpha))
        else:
            a, alpha, d = row
            T = T @ turn("x", np.deg2rad(alpha)) @ shift(a, 0) @ turn("z", angle) @ shift(0, d)
    return T


def model_of(arm: Arm) -> MultibodyPlant:
    plant = MultibodyPlant(time_step=1e-3)
    arm.add_to_plant(plant)
    plant.Finalize()
    return plant


@each_arm
def test_the_tip_is_where_denavit_and_hartenberg_have_it(name: str) -> None:
    arm, rng = get_robot(name), np.random.default_rng(0)
    for q in [np.zeros(7), arm.q_home, *rng.uniform(arm.q_min, arm.q_max, (20, 7))]:
        T, pose = flange(name, q), arm.calc_pose(q)
        p_RE = T[:3, 3] + ROD_M[name] * T[:3, 2] + MOUNT[name]
        np.testing.assert_allclose(pose.p_RE, p_RE, atol=1e-6)
        np.testing.assert_allclose(pose.R_RE[:, 0], T[:3, 2], atol=1e-6)
    np.testing.assert_allclose(arm.calc_pose(arm.q_home).R_RE[:, 0], [1.0, 0.0, 0.0], atol=1e-6)
    assert np.all(np.minimum(arm.q_home - arm.q_min, arm.q_max - arm.q_home) > 0.3)


@each_arm
def test_limits_efforts_and_inertias_are_the_published_ones(name: str) -> None:
    arm, facts = get_robot(name), FACTS[name]
    plant = model_of(arm)
    assert arm.joint_names == tuple(facts["joints"])
    for i, (joint, numbers) in enumerate(facts["joints"].items()):
        limits = [arm.q_min[i], arm.q_max[i]]
        np.testing.assert_allclose(limits, [numbers["lower"], numbers["upper"]], atol=1e-8)
        actuator = plant.GetJointActuatorByName(joint)
        assert actuator.effort_limit() == numbers["effort"]
        velocity = plant.GetJointByName(joint).velocity_upper_limits()[0]
        assert velocity == pytest.approx(numbers["velocity"])
    context = plant.CreateDefaultContext()
    for link, numbers in facts["links"].items():
        inertia = plant.GetBodyByName(link).CalcSpatialInertiaInBodyFrame(context)
        assert inertia.get_mass() == pytest.approx(numbers["mass"])
        np.testing.assert_allclose(inertia.get_com(), numbers["com"], atol=1e-9)
        about_com = inertia.Shift(inertia.get_com()).CalcRotationalInertia()
        measured = [*about_com.get_moments(), *about_com.get_products()]
        np.testing.assert_allclose(measured, numbers["inertia"], rtol=1e-6, atol=1e-9)


@each_arm
def test_the_skin_encloses_the_published_shapes(name: str) -> None:
    arm = get_robot(name)
    for link, numbers in FACTS[name]["links"].items():
        if link not in arm.link_names:  # The base is no skin.
            continue
        balls = np.array(numbers["spheres"])
        outside = np.full(len(balls), np.inf)
        for shape in (shape for shape in arm.skin if shape.link == link):
            radius, length = shape.size
            p_SQ = (balls[:, :3] - shape.p_LS) @ shape.R_LS
            p_SQ[:, 2] -= np.clip(p_SQ[:, 2], -0.5 * length, 0.5 * length)
            beyond = np.linalg.norm(p_SQ, axis=1) + balls[:, 3] - radius
            outside = np.minimum(outside, beyond)
        assert outside.max() < 1e-3, link
        assert outside.min() > -0.03, f"{link} is much too thick"


@each_arm
def test_the_impedance_is_as_soft_as_the_pr2s_and_damped(name: str) -> None:
    arm = get_robot(name)
    give_m = []
    for robot in (arm, get_robot("pr2")):
        J = robot.calc_pose(robot.q_home).Jv_E
        give_m.append(3.0 * np.linalg.eigvalsh(J / robot.stiffness @ J.T)[-1])
    assert give_m[0] == pytest.approx(give_m[1], rel=0.5)
    plant = model_of(arm)
    context = plant.CreateDefaultContext()
    plant.SetPositions(context, arm.q_home)
    critical = 2.0 * np.sqrt(arm.stiffness * np.diag(plant.CalcMassMatrix(context)))
    assert np.all(arm.damping > 0.7 * critical)
