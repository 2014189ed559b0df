"""The PR2 in a plant: mass, self-collisions, impedance and limits."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydrake.geometry import SceneGraph
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.plant import (
    AddMultibodyPlantSceneGraph,
    ExternallyAppliedSpatialForce,
    MultibodyPlant,
)
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig
from pydrake.systems.framework import Context, Diagram, DiagramBuilder
from support.pr2_reference import FACTS, mass_matrix

from lic_drake.robots.pr2 import Q_HOME, pr2_arm
from lic_drake.robots.registry import get_robot

ARM = pr2_arm()
ANGLES = st.tuples(*(st.floats(low, high) for low, high in zip(ARM.q_min, ARM.q_max, strict=True)))


class World:
    """The robot alone, in a diagram."""

    def __init__(self, height_m: float = 0.15, time_step: float = 5e-3) -> None:
        builder = DiagramBuilder()
        self.plant: MultibodyPlant
        self.scene_graph: SceneGraph
        self.plant, self.scene_graph = AddMultibodyPlantSceneGraph(builder, time_step)
        self.pr2 = ARM.add_to_plant(self.plant, height_m=height_m)
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

    def settle(self, q: np.ndarray, f_E_W: np.ndarray, seconds: float) -> np.ndarray:
        """Where the arm comes to rest, held at q, with a force at the tool frame."""
        push = ExternallyAppliedSpatialForce()
        push.body_index = self.plant.GetBodyByName("r_wrist_roll_link").index()
        push.p_BoBq_B = np.array([0.18, 0.0, 0.0])
        push.F_Bq_W = SpatialForce(np.zeros(3), f_E_W)
        self.plant.get_applied_spatial_force_input_port().FixValue(self.context, [push])
        at_rest = np.concatenate([q, np.zeros(7)])
        self.plant.get_desired_state_input_port(self.pr2).FixValue(self.context, at_rest)
        self.plant.SetPositionsAndVelocities(self.context, self.pr2, at_rest)
        self.root.SetTime(0.0)
        simulator = Simulator(self.diagram, self.root)
        if self.plant.time_step() == 0.0:
            ApplySimulatorConfig(
                SimulatorConfig(integration_scheme="cenic", accuracy=1e-4, max_step_size=0.01),
                simulator,
            )
        simulator.AdvanceTo(seconds)
        return np.array(self.plant.GetPositions(self.context, self.pr2))


WORLD = World()


def test_the_joint_limits_are_the_controllers_within_the_robots() -> None:
    np.testing.assert_allclose(
        np.rad2deg(ARM.q_min), [-109.0, -24.0, -220.0, -132.0, -270.0, -119.977, -180.0], atol=1e-3
    )
    np.testing.assert_allclose(
        np.rad2deg(ARM.q_max), [26.0, 68.0, 41.0, 0.0, 270.0, 0.0, 180.0], atol=1e-9
    )
    assert np.all((Q_HOME > ARM.q_min) & (Q_HOME < ARM.q_max))
    assert get_robot("pr2") is ARM


@given(ANGLES)
def test_the_mass_matrix_is_that_of_the_published_numbers(angles: tuple[float, ...]) -> None:
    q = np.array(angles)
    WORLD.plant.SetPositions(WORLD.context, WORLD.pr2, q)
    M = WORLD.plant.CalcMassMatrix(WORLD.context)
    np.testing.assert_allclose(M, mass_matrix(q), atol=1e-8)


def test_nothing_touches_at_home_or_in_the_middle_of_the_limits() -> None:
    for torso_m in (0.0115, 0.15, 0.305):
        world = World(torso_m)
        assert world.touching(Q_HOME) == set()
        assert world.touching(0.5 * (ARM.q_min + ARM.q_max)) == set()


def test_only_forearm_and_hand_ever_touch_the_rest_of_the_robot() -> None:
    rng = np.random.default_rng(0)
    far = {f"r_{name}_link" for name in ("elbow_flex", "forearm_roll", "wrist_flex", "wrist_roll")}
    joints = [FACTS["joints"][name] for name in FACTS["chain"][1:]]
    hard_min = np.array([-np.pi if j["lower"] is None else j["lower"] for j in joints])
    hard_max = np.array([np.pi if j["upper"] is None else j["upper"] for j in joints])
    count, num_touching = 0, 0
    for torso_m in rng.uniform(0.0115, 0.305, 10):
        world = World(torso_m)
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
    world = World(time_step=time_step)
    for f_E_W in 3.0 * np.eye(3):
        q = world.settle(Q_HOME, f_E_W, seconds=4.0)
        torque = ARM.calc_pose(q).Jv_E.T @ f_E_W
        assert np.max(np.abs(torque)) > 0.2
        np.testing.assert_allclose(ARM.stiffness * (q - Q_HOME), torque, atol=2e-3)
