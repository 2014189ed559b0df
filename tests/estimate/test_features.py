import numpy as np
import pytest

from lic_drake.estimate.checks import EstimateError
from lic_drake.estimate.features import PLANAR_LIC1, SPACE_LIC1, FeatureMap
from lic_drake.experience.second_reach import SHOWN


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


SECOND = FeatureMap(
    goal=("goal_x", "goal_y"),
    observed=(
        "first_start_y",
        "first_start_phi",
        "first_final_x",
        "first_final_y",
        "first_final_phi",
        "first_final_vx",
        "first_final_vy",
    ),
    start=("start_x", "start_y", "start_phi"),
)


@pytest.fixture
def pairs(columns) -> dict[str, np.ndarray]:
    shown = {f"first_{name}": np.array([i + 0.5, -i]) for i, name in enumerate(SHOWN)}
    base = {"base_x": np.array([0.25, 0.0]), "base_y": np.array([-0.5, 1.0])}
    return columns | shown | base


def test_the_situation_is_goal_and_observation(pairs) -> None:
    Z = SECOND.rows(pairs).Z
    assert SECOND.names == SECOND.goal + SECOND.observed + SECOND.start
    assert Z[:, SECOND.situation].shape == (2, 9)
    assert Z[:, SECOND.decision].shape == (2, 3)


def test_positions_are_told_from_the_base_and_angles_and_velocities_are_not(pairs) -> None:
    moved = SECOND.rows(pairs).Z
    del pairs["base_x"], pairs["base_y"]
    by_column = dict(zip(SECOND.names, (SECOND.rows(pairs).Z - moved).T, strict=True))
    for name, difference in by_column.items():
        expected = {"x": [0.25, 0.0], "y": [-0.5, 1.0]}.get(name.rsplit("_", 1)[1], [0.0, 0.0])
        np.testing.assert_allclose(difference, expected, err_msg=name)


def test_a_situation_moved_with_its_base_has_the_same_features(pairs) -> None:
    before = SECOND.rows(pairs).Z
    for name in list(pairs):
        if name.endswith(("_x", "_y")):
            pairs[name] = pairs[name] + (0.3 if name.endswith("_x") else -0.7)
    np.testing.assert_allclose(SECOND.rows(pairs).Z, before)


def test_joining_with_an_observation_gives_the_row_of_the_pair(pairs) -> None:
    b0 = np.array([pairs["base_x"][0], pairs["base_y"][0], 0.0])
    first = {name: pairs[f"first_{name}"][0] for name in SHOWN}
    observed = SECOND.observation(first, b0)
    p_RG = np.array([pairs[f"goal_{axis}"][0] for axis in "xyz"]) - b0
    x0 = np.array([pairs[f"start_{name}"][0] for name in ("x", "y", "phi")]) - b0
    np.testing.assert_allclose(SECOND.join(p_RG, x0, observed), SECOND.rows(pairs).Z[0])
    many = SECOND.join(p_RG, np.tile(x0, (4, 2, 1)), observed)
    assert many.shape == (4, 2, 12)
    np.testing.assert_allclose(many[3, 1], SECOND.rows(pairs).Z[0])


def test_the_gradient_by_the_base_is_the_derivative_with_the_world_standing_still() -> None:
    rng = np.random.default_rng(0)
    weight = rng.normal(size=len(SECOND.names))
    p_WG, x0, base = rng.normal(size=3), rng.normal(size=3), np.append(rng.normal(size=2), 0.0)
    first = dict(zip(SHOWN, rng.normal(size=len(SHOWN)), strict=True))

    def value(b0):
        return weight @ SECOND.join(p_WG - b0, x0 - b0, SECOND.observation(first, b0))

    numeric = [(value(base + step) - value(base - step)) / 2e-3 for step in 1e-3 * np.eye(2, 3)]
    # No torso carries a robot in the plane.
    np.testing.assert_allclose(SECOND.gradient_by_base(weight), [*numeric, 0.0], atol=1e-9)
    np.testing.assert_array_equal(
        PLANAR_LIC1.gradient_by_base(np.arange(1.0, 5.0)), [-1.0, -5.0, 0.0]
    )


def test_a_first_reach_that_never_began_shows_nothing() -> None:
    first = dict.fromkeys(SHOWN, 0.1) | {"final_x": np.nan}
    with pytest.raises(EstimateError, match=r"first_final_x.*never began"):
        SECOND.observation(first)
    assert PLANAR_LIC1.observation({}).shape == (0,)


@pytest.mark.parametrize("observed", [None, np.zeros(3)])
def test_joining_without_the_observation_is_refused(observed) -> None:
    with pytest.raises(EstimateError, match="7 observed features"):
        SECOND.join(np.zeros(3), np.zeros(3), observed)


def test_observed_features_are_columns_of_the_first_reach() -> None:
    with pytest.raises(EstimateError, match="observed features must be some of first_start_x"):
        FeatureMap(goal=("goal_x",), start=("start_y",), observed=("final_x",))


# In space


IN_SPACE = FeatureMap(
    goal=("goal_x", "goal_y", "goal_z"),
    observed=("first_start_z", "first_start_qx", "first_final_z", "first_final_vz"),
    start=("start_x", "start_y", "start_z", "start_qw", "start_qx", "start_qy", "start_qz"),
)
POSE = ("x", "y", "z", "qw", "qx", "qy", "qz")


@pytest.fixture
def pairs_in_space(pairs) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(4)
    return (
        pairs
        | {f"start_{name}": rng.normal(size=2) for name in POSE}
        | {
            "goal_z": np.array([0.9, 1.1]),
            "torso": np.array([0.2, 0.05]),
        }
    )


def test_heights_are_told_from_the_torso_and_rotations_and_velocities_are_not(
    pairs_in_space,
) -> None:
    moved = IN_SPACE.rows(pairs_in_space).Z
    for name in ("base_x", "base_y", "torso"):
        del pairs_in_space[name]
    difference = IN_SPACE.rows(pairs_in_space).Z - moved
    b0 = {"x": [0.25, 0.0], "y": [-0.5, 1.0], "z": [0.2, 0.05]}
    for name, column in zip(IN_SPACE.names, difference.T, strict=True):
        expected = b0.get(name.rsplit("_", 1)[1], [0.0, 0.0])
        np.testing.assert_allclose(column, expected, atol=1e-12, err_msg=name)


def test_joining_in_space_gives_the_row_of_the_pair(pairs_in_space) -> None:
    row = {name: values[0] for name, values in pairs_in_space.items()}
    b0 = np.array([row["base_x"], row["base_y"], row["torso"]])
    observed = IN_SPACE.observation({name: row[f"first_{name}"] for name in SHOWN}, b0)
    p_RG = np.array([row[f"goal_{axis}"] for axis in "xyz"]) - b0
    x0 = np.array([row[f"start_{name}"] for name in POSE]) - np.append(b0, np.zeros(4))
    expected = IN_SPACE.rows(pairs_in_space).Z[0]
    np.testing.assert_allclose(IN_SPACE.join(p_RG, x0, observed), expected)
    few = SPACE_LIC1.join(p_RG, np.tile(x0, (3, 1)))
    np.testing.assert_allclose(few, np.tile([*p_RG[1:], *x0[[1, 2, 4]]], (3, 1)))


def test_the_gradients_in_space_are_the_derivatives_through_join() -> None:
    rng = np.random.default_rng(1)
    first = dict(zip(SHOWN, rng.normal(size=len(SHOWN)), strict=True))
    p_WG, x0, b0 = rng.normal(size=3), rng.normal(size=7), rng.normal(size=3)
    for features in (IN_SPACE, SPACE_LIC1):
        weight = rng.normal(size=len(features.names))

        def value(x0, b0, features=features, weight=weight):
            x0_R = x0 - np.append(b0, np.zeros(4))
            return weight @ features.join(p_WG - b0, x0_R, features.observation(first, b0))

        by_x0 = [(value(x0 + e, b0) - value(x0 - e, b0)) / 2e-3 for e in 1e-3 * np.eye(7)]
        by_b0 = [(value(x0, b0 + e) - value(x0, b0 - e)) / 2e-3 for e in 1e-3 * np.eye(3)]
        np.testing.assert_allclose(features.gradient_by_x0(weight), by_x0, atol=1e-9)
        np.testing.assert_allclose(features.gradient_by_base(weight), by_b0, atol=1e-9)


def test_features_know_whether_they_are_of_space() -> None:
    assert IN_SPACE.in_space and SPACE_LIC1.in_space
    assert not PLANAR_LIC1.in_space and not SECOND.in_space


def test_a_start_of_both_plane_and_space_is_refused() -> None:
    with pytest.raises(EstimateError, match="start features are of the plane or of space, got"):
        FeatureMap(goal=("goal_x",), start=("start_z", "start_phi"))
