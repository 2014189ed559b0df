import cProfile
import gc
import pstats
import time

import numpy as np
import pytest

from lic_drake.control.mpc import QuadraticProgram, solve
from lic_drake.evaluate.speed import split_time


def test_time_of_other_functions_is_that_of_the_parts_that_call_them() -> None:
    n, k = np.zeros(3), np.zeros((0, 3))
    problem = QuadraticProgram(np.eye(3), n, k, n - 1.0, n + 1.0)
    # Other threads must not count, nor what the collector finds of other tests.
    gc.disable()
    try:
        with cProfile.Profile(time.thread_time) as profile:
            for _ in range(1000):
                solve(problem)
    finally:
        gc.enable()
    split = split_time(pstats.Stats(profile))
    assert sum(split.values()) == pytest.approx(1.0)
    assert split["mpc"] > 0.9
