from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.fake_reach import make_record, make_request

from lic_drake.errors import LibraryError
from lic_drake.experience.pairs import SHOWN, pair_reaches, pair_second_attempts
from lic_drake.experience.schema import to_table
from lic_drake.reach.request import ReachRequest
from lic_drake.reach.start import Start


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


def _attempts(requests: list[ReachRequest]) -> dict[str, np.ndarray[Any, Any]]:
    table = to_table([make_record(r) for r in requests], requests[0].scenario)
    return {name: table.column(name).to_numpy() for name in table.column_names}


def test_second_attempts_are_paired_with_their_first_attempts() -> None:
    requests = make_request().reaches(0)
    firsts, others = requests[:2], requests[2:5]
    seconds = [f.then(Start(o.start.x0, np.array([0.0, 0.2, 0.0]))) for f in firsts for o in others]
    third = seconds[0].then(firsts[0].start)  # To be ignored.
    pairs = pair_second_attempts(_attempts([*firsts, *seconds, third]))
    assert pairs["key"].tolist() == [second.key for second in seconds]
    np.testing.assert_array_equal(pairs["first_start_y"], [s.after[0].x0[1] for s in seconds])
    finals = {request.key: make_record(request).final_x for request in firsts}
    expected = [finals[firsts[i // len(others)].key] for i in range(len(seconds))]
    np.testing.assert_array_equal(pairs["first_final_x"], expected)
    np.testing.assert_array_equal(pairs["base_y"], 0.2)


def test_libraries_without_second_attempts_or_columns_are_rejected() -> None:
    first, other, *_ = make_request().reaches(0)
    with pytest.raises(LibraryError, match="holds no second attempts"):
        pair_second_attempts(_attempts([first, other]))
    second = first.then(other.start)
    with pytest.raises(LibraryError, match="lacks the first attempt"):
        pair_second_attempts(_attempts([second, other]))
    columns = _library(3, np.random.default_rng(0))
    del columns["final_vx"]
    with pytest.raises(LibraryError, match="no column 'final_vx'"):
        pair_reaches(columns)
