import time

import pytest

from lic_drake.control.mpc_controller import HapticMpcController
from lic_drake.evaluate.speed import Stopwatch, measure_reaches
from lic_drake.reach.scenario import load_scenario


def test_speed_counts_reaches_and_splits_all_of_their_time() -> None:
    before = HapticMpcController._update
    scenario = load_scenario(
        "cylinder-clutter", "{clutter: {num_movable: 2, num_fixed: 2}, stop: {timeout_s: 0.4}}"
    )
    speed = measure_reaches(scenario, reaches=3, per_environment=2)
    assert speed.reaches <= 3
    assert speed.simulated_s == pytest.approx(0.4 * speed.reaches)
    assert speed.wall_per_sim_s > 0.0
    assert set(speed.split) == {"physics", "sensor", "mpc", "build", "rest"}
    assert sum(speed.split.values()) == pytest.approx(1.0)
    assert all(share >= 0.0 for share in speed.split.values())
    assert HapticMpcController._update is before


class Nested:
    """A method that calls another one."""

    def outer(self) -> None:
        self.inner()

    def inner(self) -> None:
        time.sleep(0.02)


def test_time_in_a_watched_method_is_not_its_callers() -> None:
    with Stopwatch(Nested, "outer") as outer, Stopwatch(Nested, "inner") as inner:
        Nested().outer()
    assert inner.seconds >= 0.02
    assert 0.0 <= outer.seconds < 0.01
