import cProfile
import pstats

import numpy as np
import pytest

from lic_drake.control.mpc import QuadraticProgram, solve
from lic_drake.evaluate.speed import measure_reaches, split_time
from lic_drake.reach.scenario import load_scenario


def test_speed_counts_reaches_and_splits_all_of_their_time() -> None:
    scenario = load_scenario(
        "cylinder-clutter", "{clutter: {num_movable: 2, num_fixed: 2}, stop: {timeout_s: 0.4}}"
    )
    speed = measure_reaches(scenario, reaches=3, per_environment=2)
    assert speed["reaches"] <= 3
    assert speed["simulated_s"] == pytest.approx(0.4 * speed["reaches"])
    assert speed["wall_per_sim_s"] > 0.0
    assert set(speed["split"]) == {"physics", "sensor", "mpc", "build", "rest"}
    assert sum(speed["split"].values()) == pytest.approx(1.0)
    assert min(speed["split"]["physics"], speed["split"]["mpc"]) > 0.02


def test_time_of_other_functions_is_that_of_the_parts_that_call_them() -> None:
    n, k = np.zeros(3), np.zeros((0, 3))
    problem = QuadraticProgram(np.eye(3), n, k, np.zeros(0), np.zeros(0), n - 1.0, n + 1.0)
    with cProfile.Profile() as profile:
        for _ in range(100):
            solve(problem)
    assert split_time(pstats.Stats(profile))["mpc"] > 0.9
