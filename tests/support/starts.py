"""Feasible starts for tests, and whether one is feasible by other means than theirs."""

from functools import cache

import numpy as np
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant

from lic_drake.reach.scenario import load_scenario
from lic_drake.reach.start import Start, Starts
from lic_drake.reach.task import BaseTrack, StartLine
from lic_drake.robots.planar import planar_arm
from lic_drake.starts import LineStarts
from lic_drake.starts.line import scan

ARM = planar_arm()
LINE = LineStarts(robot=ARM, line=StartLine())

_TASK = load_scenario("cylinder-aperture-clutter").task


def aperture_starts(
    y: list[float], offset: tuple[float, float] = (0.0, 0.0), track: BaseTrack | None = None
) -> LineStarts:
    """Starts of the shipped scenario at apertures with centres at y, metres.

    Args:
        y: Where the apertures are.
        offset: By how much apertures and track are moved, metres.
        track: Where the base may stand; by default as the scenario has it.
    """
    track = track or _TASK.base
    assert track is not None
    moved = BaseTrack(y_min_m=track.y_min_m + offset[1], y_max_m=track.y_max_m + offset[1])
    x_m = _TASK.start_line.x_m + offset[0]
    centres = np.array([[x_m, value + offset[1], 0.0] for value in y])
    return LineStarts(robot=ARM, line=_TASK.start_line, track=moved, p_WA=centres)


APERTURES = aperture_starts([-0.35, 0.05, 0.52])


@cache
def _plant() -> MultibodyPlant:
    plant = MultibodyPlant(time_step=1e-3)
    ARM.add_to_plant(plant)
    plant.Finalize()
    return plant


def hand_pose_by_drake(q: np.ndarray, b0: np.ndarray) -> np.ndarray:
    """The hand pose (x, y, phi) of joint angles with the base at b0, from Drake's kinematics."""
    plant = _plant()
    context = plant.CreateDefaultContext()
    plant.SetPositions(context, q)
    X_RE: RigidTransform = plant.GetFrameByName("tip").CalcPoseInWorld(context)
    x, y, _ = X_RE.translation() + b0
    # The arm of q = 0 points along -y.
    R_RL = plant.EvalBodyPoseInWorld(context, plant.GetBodyByName("link3")).rotation().matrix()
    return np.array([x, y, np.arctan2(-R_RL[1, 1], -R_RL[0, 1])])


def assert_feasible(starts: LineStarts, start: Start) -> None:
    """Checks a start with joint angles against the task and Drake's kinematics."""
    x0, b0, q, line = start.x0, start.b0, start.q, starts.line
    assert q is not None
    np.testing.assert_allclose(hand_pose_by_drake(q, b0), x0, atol=1e-9)
    assert np.all(q >= ARM.q_min - 1e-9)
    assert np.all(q <= ARM.q_max + 1e-9)
    x0_R = x0 - [b0[0], b0[1], 0.0]
    assert np.deg2rad(line.phi_min_deg) - 1e-9 <= x0[2] <= np.deg2rad(line.phi_max_deg) + 1e-9
    assert abs(x0_R[0] - line.x_m) < 1e-9
    assert line.y_min_m - 2e-6 <= x0_R[1] <= line.y_max_m + 2e-6
    if starts.track is None or starts.p_WA is None:
        assert not np.any(b0)
        return
    assert np.linalg.norm(starts.p_WA[:, :2] - x0[:2], axis=1).min() < 1e-9
    assert starts.track.y_min_m - 1e-6 <= b0[1] <= starts.track.y_max_m + 1e-6


@cache
def _scan(mobile: bool) -> Starts:
    return scan(ARM, (APERTURES if mobile else LINE).line, 81, 61)


def dense_scan(starts: LineStarts) -> Starts:
    """Feasible starts 10 mm and 3 degrees (1.5 at apertures) apart."""
    poses = _scan(starts.track is not None)
    if starts.track is None or starts.p_WA is None:
        return poses
    x0, b0 = [], []
    for p_WA in starts.p_WA:
        base = np.column_stack([p_WA[:2] - poses.x0[:, :2], np.zeros(len(poses))])
        on_track = (base[:, 1] >= starts.track.y_min_m) & (base[:, 1] <= starts.track.y_max_m)
        x0.append((poses.x0 + base)[on_track])
        b0.append(base[on_track])
    return Starts(np.vstack(x0), np.vstack(b0))
