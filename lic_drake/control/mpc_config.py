"""Parameters of the quasi-static MPC, with the published presets."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from lic_drake.config import check_numbers


@dataclass(kw_only=True)
class MpcConfig:
    """Parameters of `lic_drake.control.mpc`; SI units, angles in degrees where named so.

    Source: gt-ros-pkg/hrl-haptic-manip (facts only). Infinite values switch a limit off.
    """

    # Control rate, Hz.
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
    # Whether the equilibrium angles, too, must satisfy the joint limits.
    equilibrium_in_limits: bool = True
    # Whether a joint beyond its limit may stay there (else it must return in one step).
    forgive_joint_limits: bool = True
    # Distance to the goal within which the tip is not moved, m.
    deadzone_m: float = 0.0

    def __post_init__(self) -> None:
        # Limits may be infinite, and a negative rise is a required decrease.
        limits = "fall_below_N fall_over_N max_change_deg max_windup_deg reset_windup_deg"
        check_numbers(
            self,
            # The weight on torque changes makes the solution unique.
            positive="force_threshold_N contact_stiffness_N_per_m tip_step_m"
            " torque_change_weight".split(),
            non_negative="force_trim_N slow_distance_m position_weight force_weight"
            " force_decrease_N deadzone_m".split(),
            ranges={
                "rate_hz": (1.0, 1000.0),
                **dict.fromkeys(limits.split(), (0.0, np.inf)),
                **dict.fromkeys(("rise_below_N", "rise_over_N"), (-np.inf, np.inf)),
            },
        )

    @property
    def period_s(self) -> float:
        """Control period, seconds."""
        return 1.0 / self.rate_hz


def ijrr_2013() -> MpcConfig:
    """Returns the parameters of the paper's reference [1]: 100 Hz, 0.05 m/s."""
    return MpcConfig(
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


def haptic_mpc_pr2() -> MpcConfig:
    """Returns haptic_mpc_2013 with its values for the PR2 (hrl_haptic_mpc; 3 N, paper V-A)."""
    return MpcConfig(
        force_threshold_N=3.0,
        contact_stiffness_N_per_m=200.0,
        slow_distance_m=0.25,
        max_windup_deg=20.0,
        reset_windup_deg=30.0,
        deadzone_m=0.01,
    )


PRESETS: dict[str, Callable[[], MpcConfig]] = {
    "haptic_mpc_2013": MpcConfig,
    "ijrr_2013": ijrr_2013,
    "pr2": haptic_mpc_pr2,
}
"""The published parameter sets by name.

haptic_mpc_2013 is the later controller, 25 Hz, up to 0.5 m/s (hrl_haptic_mpc, simulated 3 links).
"""
