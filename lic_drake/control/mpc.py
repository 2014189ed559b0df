"""The quasi-static one-step model predictive controller of the paper's reference [1].

The arm is in static equilibrium before and after a step, contacts are linear springs along their
normals. With joint stiffness K, contact stiffness k_c, outward unit normals n_i and contact
Jacobians J_i, a change dphi of the equilibrium angles changes joint angles, tip and forces by

    dtheta = S dphi,  S = (K + sum_i k_c J_i' n_i n_i' J_i)^-1 K
    dx     = J_E S dphi
    df_i   = k_c n_i' J_i S dphi

The problem's terms follow gt-ros-pkg/hrl-haptic-manip (facts only). No Drake here: the cost terms
differ by six orders of magnitude, at which interior-point solvers with absolute tolerances fail
(Clarabel in thousands of steps of the 100 Hz preset). The active-set solver DAQP is exact:
Arnstrom, Bemporad and Axehill, A Dual Active-Set Solver for Embedded Quadratic Programming Using
Recursive LDL' Updates, IEEE TAC 2022.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import daqp
import numpy as np
from scipy.linalg.lapack import dposv

from lic_drake.config import check_numbers
from lic_drake.types import Vector


@dataclass(kw_only=True)
class MpcConfig:
    """Parameters of the controller; SI units, angles in degrees where named so.

    Source: gt-ros-pkg/hrl-haptic-manip (facts only). Infinite values switch a limit off.
    """

    rate_hz: float = 25.0
    # Contact forces up to this threshold are acceptable, N (paper V-A: 5 N in 2-D, 3 N in 3-D).
    force_threshold_N: float = 5.0
    # Taxel forces up to this value are ignored, N.
    force_trim_N: float = 1.0
    # Assumed stiffness of every contact, N/m.
    contact_stiffness_N_per_m: float = 1000.0
    # Desired tip motion per step, m; proportional to the distance once the goal is nearer than
    # `slow_distance_m` (0: the remaining error if it is smaller than the step).
    tip_step_m: float = 0.02
    slow_distance_m: float = 0.1
    # Weights: tip position; squared joint torque change ("jerk"); force over the threshold.
    position_weight: float = 1.0
    torque_change_weight: float = 1e-4
    force_weight: float = 0.005
    # Whether the force term is divided by the number of contacts over the threshold.
    force_weight_shared: bool = True
    # Desired decrease of a force over the threshold, N per step.
    force_decrease_N: float = 0.1
    # Limits of the predicted force change per step, N, below and over the threshold.
    rise_below_N: float = 0.1
    fall_below_N: float = np.inf
    rise_over_N: float = 0.0
    fall_over_N: float = 10.0
    # Limits of the equilibrium angles, degrees: change per step, distance from the joint angles
    # ("wind-up"), distance to which they are reset.
    max_change_deg: float = 0.5
    max_windup_deg: float = 30.0
    reset_windup_deg: float = 45.0
    # Whether the equilibrium angles, too, must satisfy the joint limits, and whether a joint beyond
    # its limit may stay there (else it must return in one step).
    equilibrium_in_limits: bool = True
    forgive_joint_limits: bool = True
    # Distance to the goal within which the tip is not moved, m.
    deadzone_m: float = 0.0

    def __post_init__(self) -> None:
        # Limits may be infinite, and a negative rise is a required decrease. The weight on torque
        # changes makes the solution unique.
        limits = "fall_below_N fall_over_N max_change_deg max_windup_deg reset_windup_deg".split()
        positive = "force_threshold_N contact_stiffness_N_per_m tip_step_m torque_change_weight"
        rest = "force_trim_N slow_distance_m position_weight force_weight force_decrease_N"
        ranges = dict.fromkeys(limits, (0.0, np.inf)) | {"rate_hz": (1.0, 1000.0)}
        ranges |= dict.fromkeys(("rise_below_N", "rise_over_N"), (-np.inf, np.inf))
        check_numbers(
            self,
            positive=positive.split(),
            non_negative=[*rest.split(), "deadzone_m"],
            ranges=ranges,
        )

    @property
    def period_s(self) -> float:
        """Control period, seconds."""
        return 1.0 / self.rate_hz


_IJRR_2013 = partial(
    MpcConfig,
    rate_hz=100.0,
    force_trim_N=0.5,
    tip_step_m=0.0005,
    slow_distance_m=0.0,
    torque_change_weight=1e-5,
    force_weight=1.0,
    force_weight_shared=False,
    force_decrease_N=0.2,
    fall_below_N=0.1,
    rise_over_N=-0.01,
    max_change_deg=np.inf,
    max_windup_deg=np.inf,
    reset_windup_deg=np.inf,
    equilibrium_in_limits=False,
    forgive_joint_limits=False,
)

PRESETS: dict[str, Callable[[], MpcConfig]] = {
    "haptic_mpc_2013": MpcConfig,
    "ijrr_2013": _IJRR_2013,
    "ijrr_2013_25hz": partial(
        _IJRR_2013,
        rate_hz=25.0,
        tip_step_m=0.002,
        force_decrease_N=0.8,
        rise_below_N=0.4,
        fall_below_N=0.4,
        rise_over_N=-0.04,
    ),
    "pr2": partial(
        MpcConfig,
        force_threshold_N=3.0,
        contact_stiffness_N_per_m=200.0,
        slow_distance_m=0.25,
        max_windup_deg=20.0,
        reset_windup_deg=30.0,
        deadzone_m=0.01,
    ),
}
"""The published parameter sets by name.

haptic_mpc_2013 is the later controller, 25 Hz, up to 0.5 m/s (hrl_haptic_mpc, simulated 3 links);
ijrr_2013 the one of the paper's reference [1], 100 Hz, 0.05 m/s; ijrr_2013_25hz the same in four
times longer steps (notebooks/results/calibration); pr2 the later one with its values for the PR2
(3 N: paper V-A).
"""


class MpcInput(NamedTuple):
    """State and contacts at a step, all vectors in R.

    Joint angles theta and equilibrium angles phi, shape (m,); vector from tip to goal and the tip's
    translational Jacobian; outward normals, compressing forces and Jacobians of n loaded taxels.
    """

    q: Vector
    q_d: Vector
    p_EG: Vector
    Jv_E: Vector
    normals: Vector
    forces: Vector
    Jv_C: Vector


class Prediction(NamedTuple):
    """Linear maps from dphi to joints, S, shape (m, m); tip, J_E S; and forces, shape (n, m)."""

    joint: Vector
    tip: Vector
    force: Vector


class QuadraticProgram(NamedTuple):
    """Minimise 1/2 x'Px + c'x subject to lower <= (x, Ax) <= upper.

    P is positive definite, A may have no rows, and limits may be infinite.
    """

    P: Vector
    c: Vector
    A: Vector
    lower: Vector
    upper: Vector


def solve(problem: QuadraticProgram) -> Vector | None:
    """Returns the minimiser, shape (n,), or None if there is none; LinAlgError if DAQP fails."""
    x: Vector
    # The first n limits, for which A has no rows, are those of the variables. The tolerance is in
    # the rows' units over their length.
    x, _, flag, _ = daqp.solve(*problem[:3], problem.upper, problem.lower, primal_tol=1e-10)
    if flag in (1, -1):  # Optimal, infeasible.
        return x if flag == 1 else None
    raise np.linalg.LinAlgError(f"DAQP ended with flag {flag}")


class HapticMpc:
    """One-step MPC of an arm with joint impedance."""

    def __init__(self, config: MpcConfig, stiffness: Vector, q_min: Vector, q_max: Vector) -> None:
        self.config = config
        self._K = np.diag(stiffness)
        self._effort = 2.0 * config.torque_change_weight * self._K**2
        # Limits above and below, the latter with the opposite sign, shape (2, m).
        self._limits = np.array([q_max, -q_min])
        self._max_change = np.deg2rad(config.max_change_deg)
        self._max_windup = np.deg2rad(config.max_windup_deg)
        self._reset_windup = np.deg2rad(config.reset_windup_deg)

    def step(self, state: MpcInput) -> Vector:
        """Returns the change of the equilibrium angles, shape (m,), 0 if there is none."""
        change = solve(self.make_problem(state))
        return np.zeros_like(state.q) if change is None else change

    def pull_back(self, q: Vector, q_d: Vector) -> Vector:
        """Returns equilibrium angles clipped to the wind-up reset distance from joint angles q."""
        return np.minimum(np.maximum(q_d, q - self._reset_windup), q + self._reset_windup)

    def predict(self, state: MpcInput) -> Prediction:
        """Returns the quasi-static model at a state."""
        contact = self.config.contact_stiffness_N_per_m
        # Rows n_i' J_i: motion of each contact along its normal.
        rows = (state.normals[:, None] @ state.Jv_C)[:, 0]
        _, S, _ = dposv(self._K + contact * (rows.T @ rows), self._K)
        return Prediction(joint=S, tip=state.Jv_E @ S, force=contact * (rows @ S))

    def wanted_tip_motion(self, p_EG: Vector) -> Vector:
        """Returns the desired tip motion of a step, shape (3,), metres."""
        distance = math.sqrt(p_EG @ p_EG)
        if distance < self.config.deadzone_m:
            return np.zeros(3)
        slow = max(self.config.slow_distance_m, self.config.tip_step_m)
        return p_EG * (self.config.tip_step_m / max(distance, slow))

    def make_problem(self, state: MpcInput) -> QuadraticProgram:
        """Returns the quadratic program of a step in dphi."""
        config = self.config
        model = self.predict(state)
        weight = 2.0 * config.position_weight
        P = weight * (model.tip.T @ model.tip) + self._effort
        c = (-weight * self.wanted_tip_motion(state.p_EG)) @ model.tip

        # Limits of the change of each force, of the joint angles and of the equilibrium angles:
        # rate, wind-up and joint limits.
        over, rise, fall = list[int](), list[float](), list[float]()
        for i, force in enumerate(state.forces.tolist()):
            if force > config.force_threshold_N:
                over.append(i)
                rise.append(config.rise_over_N)
                fall.append(-config.fall_over_N)
            else:
                rise.append(min(config.force_threshold_N - force, config.rise_below_N))
                fall.append(-config.fall_below_N)
        if over:
            rows = model.force[over]
            weight = 2.0 * config.force_weight
            weight /= len(over) if config.force_weight_shared else 1
            P += weight * (rows.T @ rows)
            c += weight * config.force_decrease_N * rows.sum(axis=0)
        q, q_d = (np.array([angles, -angles]) for angles in (state.q, state.q_d))
        room = self._limits - q
        if config.forgive_joint_limits:
            room = np.maximum(room, 0.0)
        change = np.minimum(self._max_change, q - q_d + self._max_windup)
        if config.equilibrium_in_limits:
            change = np.minimum(change, np.maximum(self._limits - q_d, 0.0))
        return QuadraticProgram(
            P=P,
            c=c,
            A=np.concatenate((model.force, model.joint)),
            lower=np.concatenate((-change[1], fall, -room[1])),
            upper=np.concatenate((change[0], rise, room[0])),
        )
