"""Possible initial conditions for tests, and whether one is possible by other means than theirs."""

from functools import cache

import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.plant import MultibodyPlant

from lic_drake.reach.hand_poses import HandPoses
from lic_drake.reach.scenario import load_scenario
from lic_drake.reach.start import Start, Starts
from lic_drake.reach.starts import ApertureStarts, LineStarts
from lic_drake.reach.task import BaseTrack, StartLine
from lic_drake.robots.planar import planar_arm

ARM = planar_arm()
LINE = LineStarts(poses=HandPoses(arm=ARM, line=StartLine()))

_TASK = load_scenario("cylinder-aperture-clutter").task
_POSES = HandPoses(arm=ARM, line=_TASK.start_line)


def aperture_starts(
    y: list[float], offset: tuple[float, float] = (0.0, 0.0), track: BaseTrack | None = None
) -> ApertureStarts:
    """Starts of the shipped scenario at apertures with centres at y, metres.

    Args:
        y: Where the apertures are.
        offset: By how much apertures and track are moved, metres.
        track: Where the base may stand; by default as the scenario has it.
    """
    track = track or _TASK.base
    moved = BaseTrack(y_min_m=track.y_min_m + offset[1], y_max_m=track.y_max_m + offset[1])
    x_m = _TASK.start_line.x_m + offset[0]
    centres = np.array([[x_m, value + offset[1], 0.0] for value in y])
    return ApertureStarts(poses=_POSES, track=moved, p_WA=centres)


APERTURES = aperture_starts([-0.35, 0.05, 0.52])


@cache
def _plant() -> MultibodyPlant:
    plant = MultibodyPlant(time_step=1e-3)
    ARM.add_to_plant(plant)
    plant.Finalize()
    return plant


def hand_pose_by_drake(q: np.ndarray, p_WR: np.ndarray) -> np.ndarray:
    """The hand pose (x, y, phi) of joint angles with the base at p_WR, from Drake's kinematics."""
    plant = _plant()
    context = plant.CreateDefaultContext()
    plant.SetPositions(context, q)
    X_RE: RigidTransform = plant.GetFrameByName("tip").CalcPoseInWorld(context)
    x, y, _ = X_RE.translation()
    # The arm of q = 0 points along -y.
    phi = RollPitchYaw(plant.EvalBodyPoseInWorld(context, plant.GetBodyByName("link3")).rotation())
    angle = (phi.yaw_angle() - 0.5 * np.pi + np.pi) % (2.0 * np.pi) - np.pi
    return np.array([x + p_WR[0], y + p_WR[1], angle])


def assert_possible(starts: LineStarts | ApertureStarts, start: Start) -> None:
    """Checks a start with joint angles against the task and Drake's kinematics."""
    x0, p_WR, q = start.x0, start.b0[:2], start.q
    assert q is not None
    np.testing.assert_allclose(hand_pose_by_drake(q, p_WR), x0, atol=1e-9)
    assert np.all(q >= ARM.q_min - 1e-9)
    assert np.all(q <= ARM.q_max + 1e-9)
    line = starts.poses.line
    assert np.deg2rad(line.phi_min_deg) - 1e-9 <= x0[2] <= np.deg2rad(line.phi_max_deg) + 1e-9
    assert x0[0] - p_WR[0] == line.x_m or abs(x0[0] - p_WR[0] - line.x_m) < 1e-9
    assert line.y_min_m - 1e-6 <= x0[1] - p_WR[1] <= line.y_max_m + 1e-6
    if isinstance(starts, LineStarts):
        assert not np.any(p_WR)
        return
    assert np.linalg.norm(starts.p_WA[:, :2] - x0[:2], axis=1).min() < 1e-9
    assert starts.track.y_min_m - 1e-6 <= p_WR[1] <= starts.track.y_max_m + 1e-6


@cache
def _scan(poses_id: int) -> np.ndarray:
    poses = {id(LINE.poses): LINE.poses, id(_POSES): _POSES}[poses_id]
    return poses.scan(161, 121)


def dense_scan(starts: LineStarts | ApertureStarts) -> Starts:
    """Possible initial conditions 5 mm and 1.5 degrees (0.75 at apertures) apart."""
    poses = _scan(id(starts.poses))
    if isinstance(starts, LineStarts):
        return Starts(poses, np.zeros((len(poses), 3)))
    x0, b0 = [], []
    for p_WA in starts.p_WA:
        base = p_WA[:2] - poses[:, :2]
        on_track = (base[:, 1] >= starts.track.y_min_m) & (base[:, 1] <= starts.track.y_max_m)
        x0.append(poses[on_track] + np.column_stack([base, np.zeros(len(base))])[on_track])
        b0.append(np.column_stack([base, np.zeros(len(base))])[on_track])
    return Starts(np.vstack(x0), np.vstack(b0))
