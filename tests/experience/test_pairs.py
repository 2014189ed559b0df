import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lic_drake.errors import LibraryError
from lic_drake.experience.pairs import SHOWN, pair_reaches


def _library(num_reaches: int, rng: np.random.Generator) -> dict[str, np.ndarray]:
    columns = {name: rng.normal(size=num_reaches) for name in SHOWN}
    columns["final_x"][rng.random(num_reaches) < 0.2] = np.nan
    for name in ("goal_x", "goal_y"):
        columns[name] = rng.choice([0.4, 0.5], num_reaches)
    columns["goal_z"] = np.zeros(num_reaches)
    columns["environment"] = rng.integers(0, 2, num_reaches)
    columns["stream"] = rng.choice(np.array(["training", "holdout"], dtype=object), num_reaches)
    columns["success"] = rng.random(num_reaches) < 0.5
    columns["key"] = np.array([f"{i:016x}" for i in range(num_reaches)], dtype=object)
    return columns


@given(st.integers(0, 40), st.integers(0, 10_000))
def test_the_pairs_are_those_of_two_loops(num_reaches: int, seed: int) -> None:
    columns = _library(num_reaches, np.random.default_rng(seed))
    same = ("stream", "environment", "goal_x", "goal_y", "goal_z")
    expected = []
    for i in range(num_reaches):
        if columns["success"][i] or np.isnan(columns["final_x"][i]):
            continue
        for j in range(num_reaches):
            if all(columns[name][i] == columns[name][j] for name in same):
                expected.append((columns["start_y"][i], columns["key"][j], columns["success"][j]))
    pairs = pair_reaches(columns)
    found = zip(pairs["first_start_y"], pairs["key"], pairs["success"], strict=True)
    assert list(found) == expected
    assert set(pairs) == set(columns) | {f"first_{name}" for name in SHOWN}
    by_key = {key: i for i, key in enumerate(columns["key"])}
    by_x = {x: i for i, x in enumerate(columns["start_x"])}
    first = np.array([by_x[x] for x in pairs["first_start_x"]], dtype=int)
    for name in SHOWN:
        np.testing.assert_array_equal(pairs[f"first_{name}"], columns[name][first])
    for name in ("start_phi", "final_vy", "goal_x"):
        np.testing.assert_array_equal(pairs[name], columns[name][[by_key[k] for k in pairs["key"]]])


def test_a_library_without_a_column_is_rejected() -> None:
    columns = _library(3, np.random.default_rng(0))
    del columns["final_vx"]
    with pytest.raises(LibraryError, match="no column 'final_vx'"):
        pair_reaches(columns)
