import numpy as np
import pytest
from select_surfaces import random_model

from lic_drake.estimate.categories import features_of
from lic_drake.estimate.features import FeatureMap
from lic_drake.reach.starts import InitialConditions
from lic_drake.select.objective import Objective
from lic_drake.select.situation import FailedReach

CATEGORIES = ["cylinder-clutter", "passage-clutter", "cylinder-aperture-clutter"]
ALL = FeatureMap(
    goal=("goal_x", "goal_y"),
    start=("start_x", "start_y", "start_phi"),
    observed=("first_start_x", "first_start_y", "first_final_x", "first_final_vx"),
)


def failure(rng: np.random.Generator) -> FailedReach:
    names = ("start_x", "start_y", "start_phi", "final_x", "final_y", "final_phi")
    shown = {name: float(rng.uniform(-0.4, 0.7)) for name in (*names, "final_vx", "final_vy")}
    x0 = np.array([shown[name] for name in names[:3]])
    return FailedReach(x0=x0, p_WR=rng.uniform(-0.3, 0.3, 2), shown=shown)


def conditions(rng: np.random.Generator, n: int) -> InitialConditions:
    return InitialConditions(
        rng.uniform([0.3, -0.4, -0.5], [0.4, 0.4, 1.5], (n, 3)), rng.uniform(-0.3, 0.3, (n, 2))
    )


def objective(features: FeatureMap, failures: int, seed: int) -> Objective:
    rng = np.random.default_rng(seed)
    return Objective(
        model=random_model(seed, features),
        p_WG=np.append(rng.uniform([0.45, -0.4], [0.85, 0.4]), 0.0),
        failed=tuple(failure(rng) for _ in range(failures)),
    )


CASES = [
    *((features_of(category).first, 0) for category in CATEGORIES),
    *((features_of(category).second, n) for category in CATEGORIES for n in (1, 3)),
    (ALL, 2),
]


@pytest.mark.parametrize(("features", "failures"), CASES)
@pytest.mark.parametrize("seed", range(3))
def test_gradients_by_pose_and_base_are_those_of_finite_differences(
    features: FeatureMap, failures: int, seed: int
) -> None:
    dut, step = objective(features, failures, seed), 1e-6
    (x0,), (p_WR,) = conditions(np.random.default_rng(seed + 100), 1)
    value, by_x0, by_b0 = dut.value_and_gradient(x0, p_WR)
    assert value == pytest.approx(dut.values(InitialConditions(x0[None], p_WR[None]))[0])
    moved = np.vstack([step * np.eye(5), -step * np.eye(5)]) + np.concatenate([x0, p_WR])
    ahead, behind = dut.values(InitialConditions(moved[:, :3], moved[:, 3:])).reshape(2, 5)
    expected = (ahead - behind) / (2 * step)
    np.testing.assert_allclose(np.concatenate([by_x0, by_b0]), expected, atol=1e-7)


@pytest.mark.parametrize(("features", "failures"), CASES)
def test_moving_everything_together_changes_nothing(features: FeatureMap, failures: int) -> None:
    dut, at = objective(features, failures, 3), conditions(np.random.default_rng(5), 20)
    offset = np.array([0.7, -1.9, 0.0])

    def moved(reach: FailedReach) -> FailedReach:
        shift = {"_x": offset[0], "_y": offset[1]}
        shown = {name: x + shift.get(name[-2:], 0.0) for name, x in reach.shown.items()}
        return FailedReach(x0=reach.x0 + offset, p_WR=reach.p_WR + offset[:2], shown=shown)

    there = Objective(model=dut.model, p_WG=dut.p_WG + offset, failed=tuple(map(moved, dut.failed)))
    conditions_there = InitialConditions(at.x0 + offset, at.p_WR + offset[:2])
    np.testing.assert_allclose(there.values(conditions_there), dut.values(at), rtol=1e-9)
    # The base alone makes a difference.
    elsewhere = InitialConditions(at.x0, at.p_WR + [0.0, 0.05])
    assert np.all(dut.values(elsewhere) != dut.values(at))


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
