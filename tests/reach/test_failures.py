"""What a reach does when the simulation fails: an outcome, never an exception."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from support.reaches import assert_never_began, free_space, reach_request, small_clutter

from lic_drake.control import tactile_sensor
from lic_drake.control.mpc import HapticMpc
from lic_drake.reach.session import run_reach
from lic_drake.scene import scene

FREE = free_space()


class Failing(Simulator):
    """A simulator that fails after three control periods, in Drake's way."""

    def AdvanceTo(self, boundary_time: float, *args: Any, **values: Any) -> Any:
        if boundary_time > 0.13:
            raise RuntimeError("The solver\n  failed to converge at t = 0.12")
        return super().AdvanceTo(boundary_time, *args, **values)


def test_a_solver_failure_is_an_outcome_with_what_was_measured_before(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(scene, "Simulator", Failing)
    record = run_reach(reach_request(FREE))
    assert (record.outcome, record.success) == ("diverged", False)
    assert record.detail == "The solver failed to converge at t = 0.12"
    assert record.duration_s == pytest.approx(0.12)
    assert math.isfinite(record.final_x) and len(record.q_final) == 3


def failing_after(calls: int, original: Callable[..., Any], failure: Any) -> Callable[..., Any]:
    """Returns the function with a failure, raised or returned, after some calls."""
    count = 0

    def function(*args: Any) -> Any:
        nonlocal count
        count += 1
        if count <= calls:
            return original(*args)
        if isinstance(failure, Exception):
            raise failure
        return failure

    return function


@pytest.mark.parametrize(
    ("failure", "detail"),
    [
        (np.linalg.LinAlgError("Matrix is\nsingular"), "Matrix is singular"),
        (FloatingPointError("overflow"), "overflow"),
        (ValueError("array must not contain infs"), "array must not contain infs"),
        (np.full(3, np.nan), ""),
    ],
)
def test_a_failure_of_the_controllers_mathematics_is_an_outcome(
    monkeypatch: pytest.MonkeyPatch, failure: Exception | np.ndarray, detail: str
) -> None:
    monkeypatch.setattr(HapticMpc, "step", failing_after(5, HapticMpc.step, failure))
    record = run_reach(reach_request(FREE))
    assert record.outcome == "diverged"
    assert record.detail == detail if detail else record.detail
    assert record.duration_s == pytest.approx(0.2)
    assert all(map(math.isfinite, record.q_final))


def test_a_failure_while_the_taxels_are_read_is_an_outcome(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    failing = failing_after(7, tactile_sensor.read_patches, RuntimeError("contact solver"))
    monkeypatch.setattr(tactile_sensor, "read_patches", failing)
    record = run_reach(reach_request(FREE))
    assert (record.outcome, record.detail) == ("diverged", "contact solver")


def test_a_reach_that_fails_before_its_first_sample_has_no_measurements(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(Failing, "AdvanceTo", failing_after(0, print, RuntimeError("x" * 1000)))
    monkeypatch.setattr(scene, "Simulator", Failing)
    record = run_reach(reach_request(FREE))
    assert_never_began(record, "diverged")
    assert record.detail == "x" * 200


def test_the_next_reach_is_not_harmed_by_a_failure(monkeypatch: pytest.MonkeyPatch) -> None:
    request = reach_request(small_clutter(1.0))
    expected = run_reach(request)
    with monkeypatch.context() as patch:
        patch.setattr(scene, "Simulator", Failing)
        assert run_reach(request).outcome == "diverged"
    assert run_reach(request) == expected
