import numpy as np
import pytest
from support.select_surfaces import random_model

from lic_drake.estimate.features import FeatureMap, features_of
from lic_drake.experience.pairs import SHOWN
from lic_drake.reach.start import Start, Starts
from lic_drake.select.objective import Objective
from lic_drake.select.situation import FailedReach

CATEGORIES = [
    "cylinder-clutter",
    "passage-clutter",
    "cylinder-aperture-clutter",
    "sphere-aperture-clutter",
]
ALL = FeatureMap(
    goal=("goal_x", "goal_y"),
    start=("start_x", "start_y", "start_phi"),
    observed=("first_start_x", "first_start_y", "first_final_x", "first_final_vx"),
)
ALL_IN_SPACE = FeatureMap(
    goal=("goal_x", "goal_y", "goal_z"),
    start=("start_x", "start_y", "start_z", "start_qx"),
    observed=("first_start_z", "first_start_qx", "first_final_z", "first_final_vz"),
)


def failure(rng: np.random.Generator, in_space: bool) -> FailedReach:
    shown = {name: float(rng.uniform(-0.4, 0.7)) for name in SHOWN}
    angles = rng.normal(size=4) if in_space else [shown["start_phi"]]
    place = ("start_x", "start_y", "start_z") if in_space else ("start_x", "start_y")
    x0 = np.array([*(shown[name] for name in place), *angles])
    torso_m = float(rng.uniform(0.0, 0.3)) if in_space else 0.0
    return FailedReach(start=Start(x0, np.append(rng.uniform(-0.3, 0.3, 2), torso_m)), shown=shown)


def conditions(rng: np.random.Generator, n: int, in_space: bool = False) -> Starts:
    if in_space:
        place = rng.uniform([0.3, -0.4, 0.6], [0.6, 0.4, 1.2], (n, 3))
        # The estimate is a function of seven numbers, so their length need not be 1 here.
        x0 = np.hstack([place, rng.uniform(-1.0, 1.0, (n, 4))])
        return Starts(x0, rng.uniform([-0.3, -0.3, 0.0], 0.3, (n, 3)))
    x0 = rng.uniform([0.3, -0.4, -0.5], [0.4, 0.4, 1.5], (n, 3))
    return Starts(x0, rng.uniform(-0.3, 0.3, (n, 3)) * [1.0, 1.0, 0.0])


def objective(features: FeatureMap, failures: int, seed: int) -> Objective:
    rng = np.random.default_rng(seed)
    p_WG = np.append(rng.uniform([0.45, -0.4], [0.85, 0.4]), 0.9 if features.in_space else 0.0)
    return Objective(
        model=random_model(seed, features),
        p_WG=p_WG,
        failed=tuple(failure(rng, features.in_space) for _ in range(failures)),
    )


CASES = [
    *((features_of(category).first, 0) for category in CATEGORIES),
    *((features_of(category).second, n) for category in CATEGORIES[:3] for n in (1, 3)),
    (ALL, 2),
    (ALL_IN_SPACE, 2),
]


@pytest.mark.parametrize(("features", "failures"), CASES)
def test_gradients_by_pose_and_base_are_those_of_finite_differences(
    features: FeatureMap, failures: int
) -> None:
    seed = 1
    dut, step = objective(features, failures, seed), 1e-6
    at = conditions(np.random.default_rng(seed + 100), 1, features.in_space)
    (x0,), (b0,) = at.x0, at.b0
    value, by_x0, by_b0 = dut.value_and_gradient(x0, b0)
    assert (by_x0.shape, by_b0.shape) == (x0.shape, (3,))
    assert value == pytest.approx(dut.values(at)[0])
    if not features.in_space:  # A robot in the plane has no torso.
        assert by_b0[2] == 0.0
        b0, by_b0 = b0[:2], by_b0[:2]
    m, n = len(x0), len(x0) + len(b0)
    moved = np.vstack([step * np.eye(n), -step * np.eye(n)]) + np.concatenate([x0, b0])
    steps = Starts(moved[:, :m], np.pad(moved[:, m:], ((0, 0), (0, 3 + m - n))))
    ahead, behind = dut.values(steps).reshape(2, n)
    expected = (ahead - behind) / (2 * step)
    np.testing.assert_allclose(np.concatenate([by_x0, by_b0]), expected, atol=1e-7)


@pytest.mark.parametrize(("features", "failures"), CASES)
def test_moving_everything_together_changes_nothing(features: FeatureMap, failures: int) -> None:
    dut = objective(features, failures, 3)
    at = conditions(np.random.default_rng(5), 20, features.in_space)
    offset = np.array([0.7, -1.9, 0.15 if features.in_space else 0.0])
    shift = dict(zip(("_x", "_y", "_z"), offset, strict=True))

    def moved_pose(x0: np.ndarray) -> np.ndarray:
        return x0 + np.append(offset, np.zeros(x0.shape[-1] - 3))

    def moved(reach: FailedReach) -> FailedReach:
        shown = {name: x + shift.get(name[-2:], 0.0) for name, x in reach.shown.items()}
        start = Start(moved_pose(reach.start.x0), reach.start.b0 + offset)
        return FailedReach(start=start, shown=shown)

    there = Objective(model=dut.model, p_WG=dut.p_WG + offset, failed=tuple(map(moved, dut.failed)))
    conditions_there = Starts(moved_pose(at.x0), at.b0 + offset)
    np.testing.assert_allclose(there.values(conditions_there), dut.values(at), rtol=1e-9)
    # The base alone makes a difference, and so does the torso.
    elsewhere = [Starts(at.x0, at.b0 + [0.0, 0.05, 0.0])]
    if features.in_space:
        elsewhere.append(Starts(at.x0, at.b0 + [0.0, 0.0, 0.05]))
    for other in elsewhere:
        assert np.all(dut.values(other) != dut.values(at))


def test_after_several_failures_it_is_the_smallest_of_the_estimates_after_each() -> None:
    dut = objective(features_of("cylinder-clutter").second, 4, 1)
    at = conditions(np.random.default_rng(2), 50)
    each = np.array(
        [
            Objective(model=dut.model, p_WG=dut.p_WG, failed=(reach,)).values(at)
            for reach in dut.failed
        ]
    )
    np.testing.assert_array_equal(dut.values(at), each.min(axis=0))
    # It depends on the start which failure counts.
    assert len(set(each.argmin(axis=0))) > 1
