"""Stems against closed forms: springs, damping, and what pushes them."""

from dataclasses import replace

import numpy as np
import pytest
from pydrake.geometry import QueryObject
from scipy.optimize import brentq
from support.worlds import ARM, World, add_sensor, make_clutter, make_world

from lic_drake.clutter.instance import ClutterInstance, Stems
from lic_drake.reach.scenario import load_scenario
from lic_drake.robots.pr2 import RIGHT_ARM_AT_REST, pr2_arm
from lic_drake.scene.collision import CollisionChecker
from lic_drake.scene.movables import CARRIAGE_SHARE
from lic_drake.scene.scene import SceneConfig

PARKED = np.deg2rad([-150.0, 0.0, 0.0])
STIFFNESS, DAMPING, MASS, LENGTH = 4.0, 0.13, 0.08, 0.6
RADIUS = 0.004


def one_stem(p_WH: np.ndarray, stiffness: float = STIFFNESS, damping: float = DAMPING) -> Stems:
    """An upright stem with one leaf half way up, along x."""
    return Stems(
        p_WH=p_WH[None],
        R_WS=np.eye(3)[None],
        length=np.array([LENGTH]),
        radius=np.array([RADIUS]),
        mass=np.array([MASS]),
        stiffness=np.array([stiffness]),
        damping=np.array([damping]),
        leaf_stem=np.array([0]),
        p_SL=np.array([[0.04, 0.0, 0.3]]),
        R_SL=np.eye(3)[None],
        leaf_size=np.array([[0.08, 0.04, 0.002]]),
    )


def with_stems(stems: Stems) -> ClutterInstance:
    return replace(make_clutter(), stems=stems)


def world_of(stems: Stems, time_step_s: float = 0.0, q: np.ndarray = PARKED) -> World:
    config = SceneConfig(time_step_s=time_step_s)
    return make_world(q, with_stems(stems), config, extend=add_sensor)


STANDING = one_stem(np.array([0.7, 0.5, -0.3]))


@pytest.mark.parametrize("direction", [(1.0, 0.0), (0.0, 1.0), (0.6, -0.8)])
def test_a_pushed_stem_bends_as_far_as_its_spring_lets_it(direction: tuple[float, float]) -> None:
    world = world_of(STANDING)
    force, height = 3.0, 0.4
    world.push("stem0", np.array([0.0, 0.0, height]), force * np.array([*direction, 0.0]))
    world.advance(4.0)
    # The force keeps its direction: k theta = F h cos(theta) about a single axis.
    bend = brentq(lambda t: STIFFNESS * t - force * height * np.cos(t), 0.0, 1.5)
    frame = world.scene.plant.GetFrameByName("stem0")
    R_WS = frame.CalcPoseInWorld(world.plant_context).rotation().matrix()
    tilt = np.arccos(R_WS[2, 2])
    if 0.0 in direction:
        assert tilt == pytest.approx(bend, rel=2e-3)
        assert np.linalg.norm(world.objects) == pytest.approx(bend, rel=2e-3)
    else:
        # Two hinges one after the other are a spring of all directions for small angles only.
        assert tilt == pytest.approx(bend, rel=0.03)
    np.testing.assert_allclose(R_WS[:2, 2] / np.sin(tilt), direction, atol=0.03)


def test_a_released_stem_swings_and_settles_as_a_damped_oscillator() -> None:
    # SpatialInertia's solid cylinder about its end, and the hub about its own centre.
    inertia = MASS * (LENGTH**2 / 3.0 + RADIUS**2 / 4.0) + CARRIAGE_SHARE * MASS * 0.4 * RADIUS**2
    decay = DAMPING / (2.0 * inertia)
    omega = np.sqrt(STIFFNESS / inertia - decay**2)
    world = world_of(STANDING, time_step_s=2e-4)
    plant = world.scene.plant
    context = plant.GetMyMutableContextFromRoot(world.context)
    first = 0.2
    plant.SetPositions(context, world.scene.clutter, np.array([first, 0.0]))
    for _ in range(3):
        world.advance(0.05)
        t = world.context.get_time()
        expected = np.cos(omega * t) + decay / omega * np.sin(omega * t)
        expected *= first * np.exp(-decay * t)
        assert world.objects[0, 0] == pytest.approx(expected, abs=2e-3)
    world.advance(0.6)
    assert np.abs(world.objects).max() < 0.01 * first


def test_a_leaf_moves_with_its_stem() -> None:
    world = world_of(STANDING)
    plant = world.scene.plant
    context = plant.GetMyMutableContextFromRoot(world.context)
    plant.SetPositions(context, world.scene.clutter, np.array([0.0, 0.5]))
    query = world.scene.scene_graph.get_query_output_port().Eval(
        world.scene.scene_graph.GetMyContextFromRoot(world.context)
    )
    assert isinstance(query, QueryObject)
    inspector = world.scene.scene_graph.model_inspector()
    (leaf,) = (
        g for g in inspector.GetAllGeometryIds() if inspector.GetName(g).endswith("leaf0_collision")
    )
    c, s = np.cos(0.5), np.sin(0.5)
    expected = np.array([0.7 + 0.04 * c + 0.3 * s, 0.5, -0.3 - 0.04 * s + 0.3 * c])
    p_WL = query.GetPoseInWorld(leaf).translation()
    np.testing.assert_allclose(p_WL, expected, atol=1e-12)


@pytest.mark.parametrize("fixed", [False, True])
def test_an_arm_that_leans_on_a_stem_feels_its_spring(fixed: bool) -> None:
    # The straight arm along x turns its shoulder against a stem beside its last link, below a leaf.
    height, x = 0.2, 0.55
    stems = one_stem(np.array([x, 0.06, -height]), stiffness=np.inf if fixed else STIFFNESS)
    straight = np.array([0.5 * np.pi, 0.0, 0.0])
    world = world_of(stems, q=straight)
    assert world.taxel_force.sum() == 0.0
    turn = np.deg2rad(8.0)
    world.set_equilibrium(straight + [turn, 0.0, 0.0])
    world.advance(4.0)
    total = world.taxel_force.sum()
    # Statics of the shoulder: its spring holds the force's moment about it.
    torque = ARM.stiffness[0] * (straight[0] + turn - world.q[0])
    assert total == pytest.approx(torque / x, rel=0.05)
    if fixed:
        assert world.objects.size == 0
        assert total > 1.5
    else:
        bend = np.linalg.norm(world.objects)
        assert bend > 0.05
        # The stem's spring holds the force at the height of the arm, which slides up a bit.
        assert total == pytest.approx(STIFFNESS * bend / (height / np.cos(bend)), rel=0.1)
        assert 0.5 < total < 5.0


def test_stems_and_leaves_touch_nothing_of_their_own_and_rest_where_they_grew() -> None:
    # Trough, beam and board included.
    instance = load_scenario("foliage-aperture-clutter").sample_instance("training", 0)
    away = instance.translated(np.array([0.5, 0.0, 0.0]))
    world = make_world(PARKED, away, SceneConfig(time_step_s=5e-3))
    world.advance(0.1)
    np.testing.assert_array_equal(world.objects, 0.0)
    assert len(world.objects) == 40


def test_what_is_inside_is_unknown_to_a_robot_that_looks_for_a_free_start() -> None:
    robot, b0 = pr2_arm(), np.array([0.0, 0.0, 0.15])
    q = RIGHT_ARM_AT_REST
    elbow = robot.calc_pose(q).p_RL[3] + b0
    stem = one_stem(elbow - [0.0, 0.0, 0.3], stiffness=np.inf)
    assert not CollisionChecker(robot, with_stems(stem)).touches(b0, q)
