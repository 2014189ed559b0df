from dataclasses import replace

import numpy as np
import pytest

from lic_drake.errors import EstimateError
from lic_drake.estimate.features import PLANAR_LIC1, SPACE_LIC1, FeatureMap, features_of
from lic_drake.experience.pairs import SHOWN


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


def test_equal_indices_of_different_streams_are_different_environments(columns) -> None:
    assert len(set(PLANAR_LIC1.rows(columns).groups)) == 2
    columns["stream"] = np.array(["training", "training"], dtype=object)
    assert len(set(PLANAR_LIC1.rows(columns).groups)) == 1


def test_weight_and_source_are_columns_with_defaults_and_others_are_needed(columns) -> None:
    rows = PLANAR_LIC1.rows(columns)
    assert (rows.weight.tolist(), rows.simulated.tolist()) == ([1.0, 1.0], [True, True])
    columns |= {"weight": np.array([1.0, 20.0]), "source": np.array(["simulation", "lab"])}
    rows = PLANAR_LIC1.rows(columns)
    assert (rows.weight.tolist(), rows.simulated.tolist()) == ([1.0, 20.0], [True, False])
    del columns["start_phi"]
    with pytest.raises(EstimateError, match="no column 'start_phi'"):
        PLANAR_LIC1.rows(columns)


@pytest.mark.parametrize(
    ("features", "said"),
    [
        ({"goal": ("goal_x",), "start": ("goal_y",)}, "start features must be some of"),
        ({"goal": ("goal_x", "goal_x"), "start": ("start_y",)}, "each once"),
        ({"observed": ("final_x",)}, "observed features must be some of first_start_x"),
        ({"observed": ("first_final_x",), "relative": True}, "relative features need"),
    ],
)
def test_features_that_make_no_sense_are_refused(features, said) -> None:
    with pytest.raises(EstimateError, match=said):
        FeatureMap(**{"goal": ("goal_x",), "start": ("start_y",), **features})


FINAL = ("first_final_x", "first_final_y", "first_final_phi", "first_final_vx", "first_final_vy")
SECOND = FeatureMap(
    goal=("goal_x", "goal_y"),
    observed=("first_start_y", "first_start_phi", *FINAL),
    start=("start_x", "start_y", "start_phi"),
)


def test_a_first_reach_that_never_began_shows_nothing() -> None:
    first = dict.fromkeys(SHOWN, 0.1) | {"final_x": np.nan}
    with pytest.raises(EstimateError, match=r"first_final_x.*never began"):
        SECOND.observation(first)
    assert PLANAR_LIC1.observation({}).shape == (0,)
    with pytest.raises(EstimateError, match="7 observed features"):
        SECOND.join(np.zeros(3), np.zeros(3))


POSE = ("x", "y", "z", "qw", "qx", "qy", "qz")
IN_SPACE = FeatureMap(
    goal=("goal_x", "goal_y", "goal_z"),
    observed=("first_start_z", "first_start_qx", "first_final_z", "first_final_vz"),
    start=tuple(f"start_{name}" for name in POSE),
)


@pytest.fixture
def pairs(columns) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(4)
    names = [*(f"first_{name}" for name in SHOWN), *(f"start_{name}" for name in POSE)]
    names += ["base_x", "base_y", "torso", "goal_z"]
    return columns | {name: rng.normal(size=2) for name in names}


@pytest.mark.parametrize("features", [PLANAR_LIC1, SPACE_LIC1, SECOND, IN_SPACE])
def test_joining_gives_the_row_of_the_record(features: FeatureMap, pairs) -> None:
    row = {name: values[0] for name, values in pairs.items()}
    b0 = np.array([row["base_x"], row["base_y"], row["torso"]])
    observed = features.observation({name: row[f"first_{name}"] for name in SHOWN}, b0)
    p_RG = np.array([row[f"goal_{axis}"] for axis in "xyz"]) - b0
    names = POSE if features.in_space else ("x", "y", "phi")
    x0_R = np.array([row[f"start_{name}"] for name in names])
    x0_R[: 3 if features.in_space else 2] -= b0[: 3 if features.in_space else 2]
    expected = features.rows(pairs).X[0]
    np.testing.assert_allclose(features.join(p_RG, x0_R, observed), expected, atol=1e-9)
    many = features.join(p_RG, np.tile(x0_R, (4, 2, 1)), observed)
    assert many.shape == (4, 2, len(features.columns))
    np.testing.assert_allclose(many[3, 1], expected, atol=1e-9)


@pytest.mark.parametrize("features", [PLANAR_LIC1, SPACE_LIC1, SECOND, IN_SPACE])
def test_gradients_by_pose_and_base_are_the_derivatives_through_join(features: FeatureMap) -> None:
    rng = np.random.default_rng(1)
    first = dict(zip(SHOWN, rng.normal(size=len(SHOWN)), strict=True))
    axes = 3 if features.in_space else 2  # No torso carries a robot in the plane.
    p_WG, x0, b0 = rng.normal(size=3), rng.normal(size=7 if axes == 3 else 3), np.zeros(3)
    b0[:axes] = rng.normal(size=axes)
    weight = rng.normal(size=len(features.columns))

    def value(x0, b0):
        x0_R = x0.copy()
        x0_R[:axes] -= b0[:axes]
        return weight @ features.join(p_WG - b0, x0_R, features.observation(first, b0))

    h = 1e-3
    by_x0 = [(value(x0 + e, b0) - value(x0 - e, b0)) / (2 * h) for e in h * np.eye(len(x0))]
    by_b0 = [(value(x0, b0 + e) - value(x0, b0 - e)) / (2 * h) for e in h * np.eye(axes, 3)]
    np.testing.assert_allclose(features.gradient_by_x0(weight), by_x0, atol=1e-5)
    np.testing.assert_allclose(features.gradient_by_base(weight)[:axes], by_b0, atol=1e-5)


def test_in_space_the_goal_is_told_from_the_start(pairs) -> None:
    X = SPACE_LIC1.rows(pairs).X
    place = np.column_stack([pairs["start_y"], pairs["start_z"]])
    goal = np.column_stack([pairs["goal_y"], pairs["goal_z"]])
    b0 = np.column_stack([pairs["base_y"], pairs["torso"]])
    np.testing.assert_allclose(X, np.hstack([place - goal, place - b0]), atol=1e-9)
    np.testing.assert_allclose(X @ SPACE_LIC1.goal_matrix.T, goal - b0, atol=1e-9)
    # 0.3 - 0.1 and 0.4 - 0.2 differ in the last digit.
    twins = [
        SPACE_LIC1.join([0, g, 0], [0, s, 0, 1, 0, 0, 0])[0] for g, s in ((0.1, 0.3), (0.2, 0.4))
    ]
    assert twins[0] == twins[1]


def test_features_of_the_categories_are_the_paper_s() -> None:
    first_start = ("first_start_y", "first_start_phi")
    for name, observed in (
        ("cylinder-clutter", ("first_final_x", "first_final_y")),
        ("passage-clutter", ("first_final_vx", "first_final_vy")),
        ("cylinder-aperture-clutter", ()),
    ):
        second = replace(PLANAR_LIC1, observed=(*first_start, *observed))
        assert features_of(name) == (PLANAR_LIC1, second)
    for name in ("sphere-aperture-clutter", "foliage-aperture-clutter"):
        assert features_of(name) == (SPACE_LIC1, None)
