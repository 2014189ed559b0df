import numpy as np
import pytest

from lic_drake.estimate.checks import EstimateError
from lic_drake.estimate.features import PLANAR_LIC1, FeatureMap


@pytest.fixture
def columns() -> dict[str, np.ndarray]:
    return {
        "goal_x": np.array([0.4, 0.5]),
        "goal_y": np.array([-0.1, 0.2]),
        "goal_z": np.array([9.0, 9.0]),
        "start_x": np.array([9.0, 9.0]),
        "start_y": np.array([0.3, -0.3]),
        "start_phi": np.array([1.0, -0.5]),
        "success": np.array([True, False]),
        "environment": np.array([4, 4], dtype=np.int32),
        "stream": np.array(["training", "holdout"], dtype=object),
    }


def test_rows_take_their_features_from_the_columns(columns) -> None:
    rows = PLANAR_LIC1.rows(columns)
    np.testing.assert_array_equal(rows.Z, [[0.4, -0.1, 0.3, 1.0], [0.5, 0.2, -0.3, -0.5]])
    np.testing.assert_array_equal(rows.f, [1.0, 0.0])


def test_equal_indices_of_different_streams_are_different_environments(columns) -> None:
    assert len(set(PLANAR_LIC1.rows(columns).environment)) == 2
    columns["stream"] = np.array(["training", "training"], dtype=object)
    assert len(set(PLANAR_LIC1.rows(columns).environment)) == 1


def test_a_missing_column_is_named(columns) -> None:
    del columns["start_phi"]
    with pytest.raises(EstimateError, match="no column 'start_phi'"):
        PLANAR_LIC1.rows(columns)


def test_joining_goal_and_start_gives_the_row_of_their_record(columns) -> None:
    p_WG = [columns[f"goal_{axis}"][0] for axis in "xyz"]
    x0 = [columns[f"start_{name}"][0] for name in ("x", "y", "phi")]
    z = PLANAR_LIC1.join(p_WG, x0)
    np.testing.assert_array_equal(z, PLANAR_LIC1.rows(columns).Z[0])
    np.testing.assert_array_equal(z[PLANAR_LIC1.situation], p_WG[:2])
    np.testing.assert_array_equal(z[PLANAR_LIC1.decision], x0[1:])


def test_one_goal_joins_with_many_starts() -> None:
    x0 = np.arange(12.0).reshape(4, 3)
    Z = PLANAR_LIC1.join([0.5, 0.1, 0.0], x0)
    np.testing.assert_array_equal(Z, np.column_stack([[0.5] * 4, [0.1] * 4, x0[:, 1:]]))


def test_the_gradient_by_x0_is_the_derivative_through_join() -> None:
    weight = np.array([3.0, -1.0, 2.0, 5.0])
    p_WG, x0 = np.array([0.5, 0.1, 0.0]), np.array([0.335, 0.2, 1.0])
    numeric = [
        weight @ (PLANAR_LIC1.join(p_WG, x0 + step) - PLANAR_LIC1.join(p_WG, x0 - step)) / 2e-3
        for step in 1e-3 * np.eye(3)
    ]
    np.testing.assert_allclose(PLANAR_LIC1.gradient_by_x0(weight), numeric, atol=1e-9)


@pytest.mark.parametrize(
    ("goal", "start"),
    [
        ((), ("start_y",)),
        (("goal_x",), ("goal_y",)),
        (("goal_x", "goal_x"), ("start_y",)),
    ],
)
def test_features_that_make_no_sense_are_refused(goal, start) -> None:
    with pytest.raises(EstimateError, match="features must be some of"):
        FeatureMap(goal=goal, start=start)
