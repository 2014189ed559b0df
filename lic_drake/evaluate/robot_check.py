"""`check_robot`: what a robot is, and whether it reaches a goal and presses as it should.

Both reaches go through the diagram that all others use, in a scene of their own.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from lic_drake.clutter.instance import ClutterInstance, join, make_objects
from lic_drake.control.taxels import make_taxels
from lic_drake.errors import ScenarioError
from lic_drake.reach.environment import Environment
from lic_drake.reach.scenario import Scenario, load_scenario
from lic_drake.reach.trace import ReachResult
from lic_drake.robots.arm import Arm, SkinShape
from lic_drake.robots.kinematics import ArmPose
from lic_drake.robots.registry import get_robot
from lic_drake.scene.collision import CollisionChecker
from lic_drake.types import Vector

GOAL_DISTANCE_M = (0.15, 0.35)
"""Least and largest distance of the free goal from the tip at home."""

GOAL_TURN_RAD = 0.6
"""By how much each joint may differ from home at the free goal."""

WALL_GAP_M = 0.01
"""Distance of the wall from the foremost skin at home."""

BEHIND_WALL_M = 0.15
"""Distance of the goal that makes the arm press on the wall, behind the tip at home."""

PRESS_S = 10.0
"""Simulated time of pressing; the force has settled in the last quarter."""

TOLERANCE = 0.2
"""Largest deviation of the median settled force from the threshold, as a share of it."""

LARGEST = 2.0
"""Where 95 % of the settled forces must be below, as a multiple of the threshold."""

_WALL_M = (0.05, 0.5, 0.5)


@dataclass(frozen=True, kw_only=True)
class RobotCheck:
    """What `check_robot` found.

    Attributes:
        scenario: The scenario of both reaches.
        free: The reach to a free goal, p_WG, shape (3,), metres.
        wall: What the second one presses on.
        p_WG_wall: Its goal, behind it, shape (3,), metres.
        pressing: The second reach, with its states.
    """

    scenario: Scenario
    p_WG: Vector
    free: ReachResult
    wall: ClutterInstance
    p_WG_wall: Vector
    pressing: ReachResult

    @property
    def settled_N(self) -> Vector:
        """The 5th, 50th and 95th percentile of the largest taxel force, last quarter, N."""
        forces = np.array(self.pressing.trace.peak_force)
        settled: Vector = np.percentile(forces[3 * len(forces) // 4 :], [5.0, 50.0, 95.0])
        return settled

    @property
    def reaches(self) -> bool:
        """Whether the arm came to the free goal."""
        return self.free.outcome == "reached"

    @property
    def settles(self) -> bool:
        """Whether the force settled at the threshold, but for moments.

        A redundant arm goes on turning about what it presses on, and where another link comes to
        touch, the force changes until the controller has spread it.
        """
        threshold, (_, median, high) = self.scenario.mpc.force_threshold_N, self.settled_N
        close = abs(median - threshold) <= TOLERANCE * threshold
        return bool(close and high <= LARGEST * threshold)

    def values(self) -> dict[str, Any]:
        """Returns all that is worth printing, in plain types."""
        arm, trace = self.scenario.arm(), self.pressing.trace
        layout = make_taxels(arm, self.scenario.scene.taxels_per_m)
        found: dict[str, Any] = {"robot": arm.name, "joints": arm.num_joints}
        rows = (np.rad2deg(arm.q_min), np.rad2deg(arm.q_max), arm.stiffness, arm.damping)
        for name, row in zip(arm.joint_names, np.transpose(rows).tolist(), strict=True):
            keys = ("lower_deg", "upper_deg", "stiffness_Nm_per_rad", "damping_Nms_per_rad")
            found[name] = dict(zip(keys, row, strict=True))
        distances = np.linalg.norm(np.reshape(self.free.trace.p_WE, (-1, 3)) - self.p_WG, axis=1)
        step = max(1, round(0.5 * self.scenario.mpc.rate_hz))
        pressing = zip(trace.time_s[::step], trace.peak_force[::step], strict=True)
        return found | {
            "reach_m": arm.reach_m,
            "height_range_m": [x if math.isfinite(x) else None for x in arm.height_range_m],
            "skin_links": list(arm.link_names),
            "taxels": layout.num_taxels,
            "skin_area_m2": layout.num_taxels * layout.pitch_m**2,
            "free_goal": self.free.outcome,
            "free_goal_distance_m": float(distances.min()),
            "free_goal_time_s": self.free.trace.time_s[-1],
            "wall": self.pressing.outcome,
            "threshold_N": self.scenario.mpc.force_threshold_N,
            "force_N": {f"{time:.1f} s": round(force, 2) for time, force in pressing},
            "settled_N": self.settled_N.tolist(),
            "reaches": self.reaches,
            "settles": self.settles,
        }


def check_robot(name: str) -> RobotCheck:
    """Checks a robot, given by its name or file.

    Raises:
        ScenarioError: It cannot be read, or touches itself at home.
    """
    arm = get_robot(name)
    low, high = np.nan_to_num(arm.height_range_m, neginf=0.0, posinf=0.0)
    shipped = "cylinder-clutter" if arm.is_planar else "sphere-aperture-clutter"
    stop = "{stuck_distance_m: 0.0, progress_m: 0.0, force_limit_N: .inf}"
    task = f"{{torso_m: {0.5 * (low + high)}, stand: null}}"
    scenario = load_scenario(shipped, f"{{robot: {name!r}, task: {task}, stop: {stop}}}")
    b0 = scenario.task.b0
    touching = CollisionChecker(arm, join()).touching_links(b0, arm.q_home)
    if touching:
        raise ScenarioError(
            f"{arm.name} touches itself in its home posture: {', '.join(touching)}; give another"
            " home_deg or, where it must be so, ignored_contacts"
        )
    p_WG = _free_goal(arm) + b0
    x0 = arm.tip_pose(arm.q_home)
    axes = 2 if arm.is_planar else 3
    x0[:axes] += b0[:axes]
    free = Environment(scenario, join(), sleep=False).reach(p_WG, x0, q=arm.q_home)
    wall, p_WG_wall = _wall(arm, b0)
    scenario.stop.timeout_s = PRESS_S
    environment = Environment(scenario, wall, sleep=False)
    pressing = environment.reach(p_WG_wall, x0, keep_states=True, q=arm.q_home)
    if not pressing.trace.time_s:
        raise ScenarioError(f"{arm.name} cannot begin to press on a wall: {pressing.detail}")
    return RobotCheck(
        scenario=scenario,
        p_WG=p_WG,
        free=free,
        wall=wall,
        p_WG_wall=p_WG_wall,
        pressing=pressing,
    )


def _free_goal(arm: Arm) -> Vector:
    """Returns the foremost place that the tip comes to near its home posture, in R, metres."""
    rng = np.random.default_rng(0)
    turns = rng.uniform(-GOAL_TURN_RAD, GOAL_TURN_RAD, (200, arm.num_joints))
    home = arm.calc_pose(arm.q_home).p_RE
    q = np.clip(arm.q_home + turns, arm.q_min, arm.q_max)
    places = np.array([arm.calc_pose(row).p_RE for row in q])
    distance = np.linalg.norm(places - home, axis=1)
    near = (distance > GOAL_DISTANCE_M[0]) & (distance < GOAL_DISTANCE_M[1])
    places = places[near] if np.any(near) else places
    foremost: Vector = places[np.argmax(places[:, 0])]
    return foremost


def _wall(arm: Arm, b0: Vector) -> tuple[ClutterInstance, Vector]:
    """Returns an upright wall before the hand at home, or a table under it, and a goal behind.

    The wall is across the hand's direction.
    """
    pose = arm.calc_pose(arm.q_home)
    along = pose.R_RE[:, 0]
    upright = np.hypot(along[0], along[1]) > abs(along[2])
    axis = along * [1.0, 1.0, 0.0] if upright else along * [0.0, 0.0, 1.0]
    axis = axis / np.linalg.norm(axis)
    size = _WALL_M if upright else _WALL_M[::-1]
    tip = pose.p_RE + b0
    front = max(_foremost(arm, pose, shape.enclosing_capsule(), axis) for shape in arm.skin)
    beyond = max(front - float(axis @ pose.p_RE), 0.0)
    centre = tip + (beyond + WALL_GAP_M + 0.5 * _WALL_M[0]) * axis
    yaw = float(np.arctan2(axis[1], axis[0]))
    return join(make_objects("box", size, centre, yaw=yaw)), tip + (beyond + BEHIND_WALL_M) * axis


def _foremost(arm: Arm, pose: ArmPose, capsule: SkinShape, axis: Vector) -> float:
    """Returns how far a capsule of skin reaches along an axis of R, metres."""
    link = arm.link_names.index(capsule.link)
    radius, length = capsule.size
    centre = pose.p_RL[link] + pose.R_RL[link] @ capsule.p_LS
    along = pose.R_RL[link] @ capsule.R_LS[:, 2]
    return float(axis @ centre + 0.5 * length * abs(axis @ along) + radius)
