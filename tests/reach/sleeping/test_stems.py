"""When stems wake up."""

import numpy as np
import pytest
from pydrake.systems.framework import DiagramBuilder

from lic_drake.reach.scenario import load_scenario
from lic_drake.reach.sleeping.monitors import (
    GROUP_M,
    MAX_MOVE_M,
    WAKE_M,
    MovedTooFarError,
    SkinAxes,
    StemMonitor,
)
from lic_drake.scene.scene import add_scene
from lic_drake.starts import board_starts

SCENARIO = load_scenario("foliage-aperture-clutter")
INSTANCE = SCENARIO.sample_instance("calibration", 2)
ARM = SCENARIO.arm()
AXES = SkinAxes(ARM, num_axes=3)
assert INSTANCE.stems is not None
STEMS = INSTANCE.stems
Q = board_starts(SCENARIO, INSTANCE).grid.q[3]


def further_in(steps: int) -> list[np.ndarray]:
    """Joint angles of a tool that goes straight in, 4 mm a step."""
    path = [Q]
    for _ in range(steps):
        q = path[-1]
        path.append(q + np.linalg.pinv(ARM.calc_pose(q).Jv_E) @ [0.004, 0.0, 0.0])
    return path


def gaps_by_drake(q: np.ndarray) -> np.ndarray:
    """Distances from the arm to each stem with its leaves, as far as Drake can tell them.

    It knows no distance between capsules and cylinders or boxes; so all stems and leaves are
    replaced by points of theirs.
    """
    builder = DiagramBuilder()
    scene = add_scene(builder, ARM, INSTANCE, SCENARIO.scene)
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


def test_nobody_is_asleep_whom_the_arm_could_touch() -> None:
    q = further_in(30)[-1]
    monitor = StemMonitor(STEMS, AXES)
    monitor.look(q)
    gaps = gaps_by_drake(q)
    assert np.any(gaps < WAKE_M)
    assert np.all(monitor.is_awake[gaps < WAKE_M])
    # Balls around leaves are larger than those by at most half a leaf's diagonal.
    far = gaps > WAKE_M + GROUP_M + 0.5 * np.linalg.norm(STEMS.leaf_size, axis=1).max() + 0.01
    assert np.any(far) and not np.any(monitor.is_awake[far])


def test_whom_the_arm_comes_near_wakes_up_at_once_or_step_by_step() -> None:
    at_once, step_by_step = StemMonitor(STEMS, AXES), StemMonitor(STEMS, AXES)
    path = further_in(30)
    step_by_step.look(path[0])
    for q in path:
        step_by_step.look(q)
    at_once.look(q)
    assert np.any(at_once.is_awake)
    # The group that wakes up with the first one is larger, or not, by where the arm was then.
    gaps = gaps_by_drake(q)
    for monitor in (at_once, step_by_step):
        assert np.all(monitor.is_awake[gaps < WAKE_M])


def test_a_leap_of_the_arm_is_refused() -> None:
    monitor = StemMonitor(STEMS, AXES)
    monitor.look(Q)
    leap = Q + np.array([3.0 * MAX_MOVE_M, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    with pytest.raises(MovedTooFarError):
        monitor.look(leap)
