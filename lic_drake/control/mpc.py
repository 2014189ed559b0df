"""The quasi-static one-step model predictive controller of the paper's reference [1].

The arm is in static equilibrium before and after a step, contacts are linear springs along their
normals. With joint stiffness K, contact stiffness k_c, outward unit normals n_i and contact
Jacobians J_i, a change dphi of the equilibrium angles changes joint angles, tip and forces by

    dtheta = S dphi,  S = (K + sum_i k_c J_i' n_i n_i' J_i)^-1 K
    dx     = J_E S dphi
    df_i   = k_c n_i' J_i S dphi

The problem's terms follow gt-ros-pkg/hrl-haptic-manip (facts only). No Drake here.

The cost terms differ by six orders of magnitude, at which interior-point solvers with absolute
tolerances fail (Drake's Clarabel: "InsufficientProgress" in thousands of steps of the 100 Hz
preset). The active-set solver DAQP is exact: Arnstrom, Bemporad and Axehill, A Dual Active-Set
Solver for Embedded Quadratic Programming Using Recursive LDL' Updates, IEEE TAC 2022.
"""

import math
from typing import NamedTuple

import daqp
import numpy as np
from scipy.linalg.lapack import dposv

from lic_drake.control.mpc_config import MpcConfig
from lic_drake.types import Vector

PRIMAL_TOLERANCE = 1e-10
"""Maximum constraint violation, in the rows' units over their length."""

OPTIMAL, INFEASIBLE = 1, -1
"""DAQP's exit flags."""


class MpcInput(NamedTuple):
    """State and contacts at a step; m joints, n contacts, all vectors in R.

    Attributes:
        q: Joint angles theta, shape (m,), radians.
        q_d: Equilibrium angles phi, shape (m,), radians.
        p_EG: Vector from tip to goal, shape (3,), metres.
        Jv_E: Translational Jacobian of the tip, shape (3, m).
        normals: Outward unit normals of the loaded taxels, shape (n, 3).
        forces: Their normal forces, shape (n,), N, compression positive.
        Jv_C: Their translational Jacobians, shape (n, 3, m).
    """

    q: Vector
    q_d: Vector
    p_EG: Vector
    Jv_E: Vector
    normals: Vector
    forces: Vector
    Jv_C: Vector


class Prediction(NamedTuple):
    """Linear maps from dphi to the effects of a step.

    Attributes:
        joint: S, shape (m, m).
        tip: J_E S, shape (3, m), m/rad.
        force: Rows df_i / dphi, shape (n, m), N/rad.
    """

    joint: Vector
    tip: Vector
    force: Vector


class QuadraticProgram(NamedTuple):
    """Minimise 1/2 x'Px + c'x subject to row_min <= Ax <= row_max and x_min <= x <= x_max.

    P is positive definite, shape (n, n), and A has shape (k, n), where k may be 0. Limits may be
    infinite.
    """

    P: Vector
    c: Vector
    A: Vector
    row_min: Vector
    row_max: Vector
    x_min: Vector
    x_max: Vector


def solve(problem: QuadraticProgram) -> Vector | None:
    """Returns the minimiser, shape (n,), or None if the problem is infeasible.

    Raises:
        numpy.linalg.LinAlgError: P is not positive definite, or the solver failed.
    """
    # The first n limits, for which A has no rows, are those of the variables.
    x: Vector
    x, _, flag, _ = daqp.solve(
        problem.P,
        problem.c,
        problem.A,
        np.concatenate((problem.x_max, problem.row_max)),
        np.concatenate((problem.x_min, problem.row_min)),
        primal_tol=PRIMAL_TOLERANCE,
    )
    if flag == OPTIMAL:
        return x
    if flag == INFEASIBLE:
        return None
    raise np.linalg.LinAlgError(f"DAQP ended with flag {flag}")


class HapticMpc:
    """One-step MPC of an arm with joint impedance."""

    def __init__(self, config: MpcConfig, stiffness: Vector, q_min: Vector, q_max: Vector) -> None:
        self.config = config
        self._K = np.diag(stiffness)
        self._effort = config.torque_change_weight * self._K**2
        self._q_min = q_min
        self._q_max = q_max
        self._max_change = np.deg2rad(config.max_change_deg)
        self._max_windup = np.deg2rad(config.max_windup_deg)
        self._reset_windup = np.deg2rad(config.reset_windup_deg)

    def step(self, state: MpcInput) -> Vector:
        """Returns the change of the equilibrium angles, shape (m,), radians; 0 if infeasible."""
        dq_d = solve(self.make_problem(state))
        return np.zeros_like(state.q) if dq_d is None else dq_d

    def pull_back(self, q: Vector, q_d: Vector) -> Vector:
        """Returns equilibrium angles clipped to the wind-up reset distance from joint angles q."""
        return np.minimum(np.maximum(q_d, q - self._reset_windup), q + self._reset_windup)

    def predict(self, state: MpcInput) -> Prediction:
        """Returns the quasi-static model at a state."""
        contact = self.config.contact_stiffness_N_per_m
        # Rows n_i' J_i: motion of each contact along its normal.
        rows = (state.normals[:, None] @ state.Jv_C)[:, 0]
        _, S, _ = dposv(self._K + contact * rows.T @ rows, self._K)
        return Prediction(joint=S, tip=state.Jv_E @ S, force=contact * rows @ S)

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
        over = state.forces > config.force_threshold_N

        P = config.position_weight * model.tip.T @ model.tip + self._effort
        c = -config.position_weight * self.wanted_tip_motion(state.p_EG) @ model.tip
        if over.any():
            rows = model.force[over]
            weight = config.force_weight / (len(rows) if config.force_weight_shared else 1)
            P = P + weight * rows.T @ rows
            c = c + weight * config.force_decrease_N * rows.sum(axis=0)

        # Limits of the change of each force and each joint angle.
        margin = config.force_threshold_N - state.forces
        rise = np.where(over, config.rise_over_N, np.minimum(margin, config.rise_below_N))
        fall = np.where(over, config.fall_over_N, config.fall_below_N)
        down, up = self._q_min - state.q, self._q_max - state.q
        if config.forgive_joint_limits:
            down, up = np.minimum(down, 0.0), np.maximum(up, 0.0)
        # Limits of the change of the equilibrium angles: rate, wind-up and joint limits.
        wound = state.q - state.q_d
        x_min = np.maximum(-self._max_change, wound - self._max_windup)
        x_max = np.minimum(self._max_change, wound + self._max_windup)
        if config.equilibrium_in_limits:
            x_min = np.maximum(x_min, np.minimum(self._q_min - state.q_d, 0.0))
            x_max = np.minimum(x_max, np.maximum(self._q_max - state.q_d, 0.0))
        return QuadraticProgram(
            P=2.0 * P,
            c=2.0 * c,
            A=np.concatenate((model.force, model.joint)),
            row_min=np.concatenate((-fall, down)),
            row_max=np.concatenate((rise, up)),
            x_min=x_min,
            x_max=x_max,
        )
