import numpy as np
import pytest

from lic_drake.control.mpc_config import PRESETS, MpcConfig
from lic_drake.errors import ScenarioError
from lic_drake.reach.scenario import parse_scenario

INF = np.inf


def test_the_2013_controller_has_its_published_values() -> None:
    config = PRESETS["haptic_mpc_2013"]()
    assert vars(config) == {
        "rate_hz": 25.0,
        "force_threshold_N": 5.0,
        "force_trim_N": 1.0,
        "contact_stiffness_N_per_m": 1000.0,
        "tip_step_m": 0.02,  # 0.5 m/s
        "slow_distance_m": 0.1,
        "position_weight": 1.0,
        "torque_change_weight": 1e-4,
        "force_weight": 0.0005 * 10.0,
        "force_weight_shared": True,
        "force_decrease_N": 0.1,
        "rise_below_N": 0.1,
        "fall_below_N": INF,
        "rise_over_N": 0.0,
        "fall_over_N": 10.0,
        "max_change_deg": 0.5,
        "max_windup_deg": 30.0,
        "reset_windup_deg": 45.0,
        "equilibrium_in_limits": True,
        "forgive_joint_limits": True,
        "deadzone_m": 0.0,
    }
    assert config.period_s == 0.04


def test_the_controller_of_the_pr2_differs_where_its_file_does() -> None:
    published = {
        "force_threshold_N": 3.0,
        "contact_stiffness_N_per_m": 200.0,
        "slow_distance_m": 0.25,
        "max_windup_deg": 20.0,
        "reset_windup_deg": 30.0,
        "deadzone_m": 0.01,
    }
    assert vars(PRESETS["pr2"]()) == vars(PRESETS["haptic_mpc_2013"]()) | published


def test_the_controller_of_reference_1_differs_where_its_publication_does() -> None:
    published = {
        "rate_hz": 100.0,
        "force_trim_N": 0.5,
        "tip_step_m": 0.05 / 100.0,  # 0.05 m/s
        "slow_distance_m": 0.0,
        "torque_change_weight": 1e-5,
        "force_weight": 1.0,
        "force_weight_shared": False,
        "force_decrease_N": 0.2,
        "fall_below_N": 0.1,
        "rise_over_N": -0.01,
        **dict.fromkeys(("max_change_deg", "max_windup_deg", "reset_windup_deg"), INF),
        "equilibrium_in_limits": False,
        "forgive_joint_limits": False,
    }
    assert vars(PRESETS["ijrr_2013"]()) == vars(PRESETS["haptic_mpc_2013"]()) | published


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("rate_hz", 0.0, "from 1 to 1000"),
        ("force_threshold_N", INF, "a positive number"),
        ("deadzone_m", -0.01, "0 or a positive number"),
        ("fall_below_N", float("nan"), "from 0 to inf"),
    ],
)
def test_a_value_that_cannot_be_used_is_named(name: str, value: float, said: str) -> None:
    with pytest.raises(ScenarioError, match=f"{name} must be {said}, got {value}"):
        MpcConfig(**{name: value})


def test_a_scenario_starts_from_a_preset_and_may_change_single_values() -> None:
    scenario = parse_scenario(
        "{category: cylinder-clutter, robot: planar-arm}",
        "{mpc: {preset: ijrr_2013, force_threshold_N: 3.0}}",
    )
    expected = PRESETS["ijrr_2013"]()
    expected.force_threshold_N = 3.0
    assert scenario.mpc == expected
