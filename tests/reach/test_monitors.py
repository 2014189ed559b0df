"""When objects and stems wake up."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydrake.systems.framework import DiagramBuilder
from scipy.sparse.csgraph import shortest_path
from support.worlds import ARM, box, cylinder, make_clutter, make_world

from lic_drake.clutter.instance import ClutterInstance, place_discs
from lic_drake.reach.scenario import load_scenario
from lic_drake.reach.sleeping import (
    GROUP_M,
    MAX_MOVE_M,
    MOVED_M,
    PARKING_M,
    WAKE_M,
    MovedTooFarError,
    ObjectMonitor,
    SkinAxes,
    StemMonitor,
    can_sleep,
    put_to_sleep,
)
from lic_drake.scene.scene import SceneConfig, add_scene
from lic_drake.starts import board_starts

AXES = SkinAxes(ARM)
RADIUS = 0.01
Q = np.array([0.3, 1.0, 0.5])
CROWD = load_scenario("cylinder-clutter").sample_instance("calibration", 3)

ANGLES = st.tuples(*(st.floats(lo, hi) for lo, hi in zip(ARM.q_min, ARM.q_max, strict=True)))
PLACE = st.tuples(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0))


@settings(deadline=None, max_examples=15)
@given(ANGLES, PLACE)
def test_gaps_are_the_distances_that_drake_finds(
    angles: tuple[float, ...], place: tuple[float, float]
) -> None:
    q = np.array(angles)
    # In the plane of the arm a sphere is as far away as an upright cylinder, and exact in Drake.
    ball = replace(make_clutter(cylinder(*place)), shape=("sphere",))
    world = make_world(q, ball, SceneConfig())
    scene_graph = world.scene.scene_graph
    query = scene_graph.get_query_output_port().Eval(
        scene_graph.GetMyContextFromRoot(world.context)
    )
    (post,) = world.scene.objects
    expected = min(
        query.ComputeSignedDistancePairClosestPoints(skin, post).distance
        for skin in world.scene.skin_links
    )
    (gap,) = AXES.gaps(AXES.ends(q), np.array([place])) - RADIUS
    if expected > 0.0:
        assert gap == pytest.approx(expected, abs=1e-9)
    else:
        assert gap < 1e-9


def chained_gaps(q: np.ndarray, p_WO: np.ndarray, pushed: list[int]) -> np.ndarray:
    """The smallest sum of gaps from the arm, or a pushed object, to each object."""
    n = len(p_WO)
    edges = np.full((n + 1, n + 1), np.inf)
    edges[1:, 1:] = np.linalg.norm(p_WO[:, None] - p_WO, axis=2) - 2.0 * RADIUS
    edges[0, 1:] = AXES.gaps(AXES.ends(q), p_WO) - RADIUS
    edges[0, 1:][pushed] = 0.0
    # A gap of nearly 0 would mean "no edge" to SciPy.
    return shortest_path(np.maximum(edges, 1e-6), indices=0)[1:]


def crowd(seed: int) -> ClutterInstance:
    """Cylinders so dense that they stand in groups, around the arm's last link."""
    rng = np.random.default_rng(seed)
    p_WO = place_discs(rng, 30, np.array([0.3, -0.3]), np.array([0.9, 0.3]), 0.021)
    return make_clutter(*(cylinder(x, y, movable=True) for x, y in p_WO))


@settings(deadline=None, max_examples=40)
@given(
    st.integers(0, 1000),
    st.lists(st.tuples(*[st.floats(-0.005, 0.005)] * 3), min_size=1, max_size=60),
    st.data(),
)
def test_those_and_only_those_sleep_that_nothing_can_reach_before_the_next_look(
    seed: int, moves: list[tuple[float, float, float]], data: st.DataObject
) -> None:
    instance = crowd(seed)
    first = instance.p_WO[:, :2]
    monitor = ObjectMonitor(instance, AXES)
    q, awake, positions = Q.copy(), list[int](), first.copy()
    for move in [(0.0, 0.0, 0.0), *moves]:
        q = np.clip(q + move, ARM.q_min, ARM.q_max)
        if awake and data.draw(st.booleans()):
            pushed = data.draw(st.sampled_from(awake))
            positions[pushed] += data.draw(st.tuples(*[st.floats(-0.01, 0.01)] * 2))
        woken = monitor.look(q, positions[awake])
        pushed = np.flatnonzero(np.abs(positions - first).max(axis=1) > MOVED_M).tolist()
        gaps = chained_gaps(q, positions, pushed)
        assert woken == np.setdiff1d(np.flatnonzero(gaps < WAKE_M), awake).tolist()
        awake += woken
        np.testing.assert_array_equal(monitor.p_WO, positions)


def test_a_move_that_is_too_long_to_wake_up_in_time_is_told() -> None:
    angle = MAX_MOVE_M / np.linalg.norm(ARM.calc_pose(Q).p_RE[:2])
    monitor = ObjectMonitor(CROWD, AXES)
    positions = CROWD.p_WO[CROWD.movable, :2][monitor.look(Q, np.zeros((0, 2)))]
    monitor.look(Q + [0.6 * angle, 0.0, 0.0], positions)
    with pytest.raises(MovedTooFarError, match="in a control period"):
        monitor.look(Q + [1.8 * angle, 0.0, 0.0], positions)


def test_a_pushed_object_that_moves_too_far_is_told() -> None:
    tip = ARM.calc_pose(Q).p_RE
    monitor = ObjectMonitor(make_clutter(cylinder(tip[0], tip[1] + 0.02, movable=True)), AXES)
    assert monitor.look(Q, np.zeros((0, 2))) == [0]
    p_WO = tip[None, :2] + [0.0, 0.02]
    monitor.look(Q, p_WO + [0.5 * MAX_MOVE_M, 0.0])
    with pytest.raises(MovedTooFarError):
        monitor.look(Q, p_WO + [1.6 * MAX_MOVE_M, 0.0])


def test_sleepers_are_left_out_and_spares_are_parked() -> None:
    asleep = put_to_sleep(CROWD, 3)
    fixed = np.flatnonzero(~CROWD.movable)
    n, like = len(fixed), int(np.argmax(CROWD.movable))
    assert asleep.movable.tolist() == [False] * n + [True] * 3
    np.testing.assert_array_equal(asleep.p_WO[:n], CROWD.p_WO[fixed])
    assert asleep.p_WO[n:, :2].min() >= PARKING_M
    apart = asleep.p_WO[n:, None, 0] - asleep.p_WO[None, n:, 0]
    assert np.abs(apart[~np.eye(3, dtype=bool)]).min() > 10 * RADIUS
    for name in ("size", "mass", "yaw"):
        values = getattr(asleep, name)
        np.testing.assert_array_equal(values[n:], [getattr(CROWD, name)[like]] * 3)
        np.testing.assert_array_equal(values[:n], getattr(CROWD, name)[fixed])
    assert asleep.shape == (*(CROWD.shape[i] for i in fixed), *("cylinder",) * 3)


POST = cylinder(0.5, 0.0, movable=True)
CUBE = (0.1, 0.1, 0.1)


@pytest.mark.parametrize(
    ("instance", "expected"),
    [
        (CROWD, True),
        (make_clutter(POST, box(0.7, 0.0, CUBE)), True),
        (make_clutter(cylinder(0.5, 0.0), box(0.7, 0.0, CUBE)), False),
        (make_clutter(box(0.7, 0.0, CUBE, movable=True)), False),
        (make_clutter(POST, cylinder(0.7, 0.0, movable=True, radius=0.02)), False),
        (make_clutter(POST, cylinder(0.7, 0.0, movable=True, mass=2.0)), False),
    ],
)
def test_only_objects_of_one_kind_can_sleep(instance: ClutterInstance, expected: bool) -> None:
    assert can_sleep(instance) == expected


# Stems

FOLIAGE = load_scenario("foliage-aperture-clutter")
IN_LEAF = FOLIAGE.sample_instance("calibration", 2)
PR2 = FOLIAGE.arm()
PR2_AXES = SkinAxes(PR2, num_axes=3)
assert IN_LEAF.stems is not None
STEMS = IN_LEAF.stems
Q_PR2 = board_starts(FOLIAGE, IN_LEAF).grid.q[3]


def further_in(steps: int) -> list[np.ndarray]:
    """Joint angles of a tool that goes straight in, 4 mm a step."""
    path = [Q_PR2]
    for _ in range(steps):
        q = path[-1]
        path.append(q + np.linalg.pinv(PR2.calc_pose(q).Jv_E) @ [0.004, 0.0, 0.0])
    return path


def gaps_by_drake(q: np.ndarray) -> np.ndarray:
    """Distances from the arm to each stem with its leaves, as far as Drake can tell them.

    It knows no distance between capsules and cylinders or boxes; so all stems and leaves are
    replaced by points of theirs.
    """
    builder = DiagramBuilder()
    scene = add_scene(builder, PR2, IN_LEAF, FOLIAGE.scene)
    diagram = builder.Build()
    root = diagram.CreateDefaultContext()
    scene.plant.SetPositions(scene.plant.GetMyMutableContextFromRoot(root), scene.arm, q)
    query = scene.scene_graph.get_query_output_port().Eval(
        scene.scene_graph.GetMyContextFromRoot(root)
    )
    gaps = np.full(STEMS.num_stems, np.inf)
    rng = np.random.default_rng(0)
    for i in range(STEMS.num_stems):
        points = [np.array([0.0, 0.0, STEMS.length[i] * share]) for share in rng.random(30)]
        for j in np.flatnonzero(STEMS.leaf_stem == i):
            corners = 0.5 * STEMS.leaf_size[j] * rng.choice([-1.0, 1.0], (4, 3))
            points += list(STEMS.p_SL[j] + corners @ STEMS.R_SL[j].T)
        for p_SQ in points:
            p_WQ = STEMS.p_WH[i] + STEMS.R_WS[i] @ p_SQ
            near = query.ComputeSignedDistanceToPoint(p_WQ)
            for found in near:
                if found.id_G in scene.skin_links:
                    gaps[i] = min(gaps[i], found.distance)
    return gaps


def test_no_stem_is_asleep_that_the_arm_could_touch() -> None:
    path = further_in(30)
    at_once, step_by_step = StemMonitor(STEMS, PR2_AXES), StemMonitor(STEMS, PR2_AXES)
    for q in path:
        step_by_step.look(q)
    at_once.look(q)
    gaps = gaps_by_drake(q)
    assert np.any(gaps < WAKE_M)
    # The group that wakes up with the first one is larger, or not, by where the arm was then.
    for monitor in (at_once, step_by_step):
        assert np.all(monitor.is_awake[gaps < WAKE_M])
    # Balls around leaves are larger than those by at most half a leaf's diagonal.
    far = gaps > WAKE_M + GROUP_M + 0.5 * np.linalg.norm(STEMS.leaf_size, axis=1).max() + 0.01
    assert np.any(far) and not np.any(at_once.is_awake[far])
    with pytest.raises(MovedTooFarError):
        at_once.look(q + 3.0 * MAX_MOVE_M * np.eye(7)[0])
