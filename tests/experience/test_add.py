import csv
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from support.fake_reach import fill_library

from lic_drake.errors import LibraryError
from lic_drake.experience.add import add_file, add_rows, check_rows
from lic_drake.experience.check import check_library
from lic_drake.experience.collect import REQUEST_FILE, read_request
from lic_drake.experience.pairs import pair_reaches
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.reach.scenario import load_scenario

GOOD = {"success": "true", "goal_x": "0.6", "goal_y": 0.1, "start_y": 0.0, "start_phi": 1.0}
ROWS = [{**GOOD, "success": i % 2 == 0, "start_y": 0.1 * i} for i in range(4)]
PLANE = load_scenario("cylinder-clutter")
SPACE = {
    **{"success": True, "goal_x": 0.84, "goal_y": -0.29, "goal_z": 0.89},
    **{"start_x": 0.53, "start_y": -0.29, "start_z": 0.89, "base_y": 0.0, "torso": 0.15},
}


@pytest.fixture(scope="module")
def filled(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return fill_library(tmp_path_factory.mktemp("filled") / "library")


@pytest.fixture
def library(filled: Path, tmp_path: Path) -> ExperienceLibrary:
    return ExperienceLibrary(shutil.copytree(filled, tmp_path / "library"))


def write_csv(path: Path, rows: list[dict[str, object]]) -> Path:
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
    return path


def test_rows_become_a_shard_with_their_source_and_weight(library: ExperienceLibrary) -> None:
    before = {path.name: path.read_bytes() for path in library.shard_paths()}
    records = add_rows(library, ROWS, source="lab", weight=4.0)
    assert [record.success for record in records] == [True, False, True, False]
    after = {path.name: path.read_bytes() for path in library.shard_paths()}
    assert {name: after[name] for name in before} == before and len(after) == 4
    columns = library.columns()
    assert len(columns["key"]) == len(pd.read_parquet(library.path)) == 40
    assert sorted(set(zip(columns["source"], columns["weight"], strict=True))) == [
        ("lab", 4.0),
        ("simulation", 1.0),
    ]
    assert check_library(library, read_request(library.path / REQUEST_FILE)).is_sound


def test_csv_and_parquet_give_bitwise_identical_rows(
    library: ExperienceLibrary, tmp_path: Path
) -> None:
    rng = np.random.default_rng(0)
    rows = [{**row, "final_x": rng.random(), "goal_x": 0.5 + rng.random() / 10} for row in ROWS]
    from_text = add_file(library, write_csv(tmp_path / "a.csv", rows), source="lab")
    library.shard_path(from_text[0].stream).unlink()
    pd.DataFrame(rows).to_parquet(tmp_path / "a.parquet")
    records = add_file(library, tmp_path / "a.parquet", source="lab")
    assert repr(records) == repr(from_text)
    assert [record.goal_x for record in records] == [row["goal_x"] for row in rows]


def test_environments_of_sources_are_distinct_and_their_failures_become_first_reaches(
    library: ExperienceLibrary,
) -> None:
    end = {f"final_{name}": 0.1 for name in ("x", "y", "phi", "vx", "vy")}
    rows = [{**row, **(end if i else {}), "environment": 5} for i, row in enumerate(ROWS)]
    before = len(pair_reaches(library.columns())["success"])
    add_rows(library, rows, source="arm-1", weight=3.0)
    add_rows(library, ROWS[:2], source="arm-2")
    pairs = pair_reaches(library.columns())
    # Rows 1 and 3 failed, each is followed by all four; arm-2 has no final poses.
    assert len(pairs["success"]) == before + 2 * 4
    assert pairs["weight"][pairs["source"] == "arm-1"].tolist() == [3.0] * 8


def test_the_same_rows_are_not_added_twice(library: ExperienceLibrary) -> None:
    first = add_rows(library, ROWS, source="lab")
    with pytest.raises(LibraryError, match=r"4 rows of other were added before; .* delete"):
        add_rows(library, ROWS, source="other", weight=2.0)
    library.shard_path(first[0].stream).unlink()
    assert add_rows(library, ROWS, source="other", weight=2.0)[0].weight == 2.0


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"source": "../lab"}, "cannot be the name of a source"),
        ({"source": "simulation"}, "cannot be the name of a source"),
        ({"weight": 0.0}, "from 0.001 to 1000 simulated reaches, got 0"),
        ({"weight": float("nan")}, "got nan"),
        ({"rows": [*ROWS, {**ROWS[0], "goal_y": 9}]}, "row 5: the goal"),
        ({"rows": []}, "lab holds no rows"),
    ],
)
def test_a_rejected_addition_leaves_the_library_unchanged(
    values: dict[str, object], message: str, library: ExperienceLibrary
) -> None:
    arguments = {"rows": ROWS, "source": "lab", "weight": 1.0, **values}
    with pytest.raises(LibraryError, match=message):
        add_rows(library, arguments.pop("rows"), **arguments)
    assert len(library.shard_paths()) == 3
    with pytest.raises(LibraryError, match="is a single file"):
        add_rows(ExperienceLibrary(library.shard_paths()[0]), ROWS, source="lab")


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("rows.txt", b"", ".csv or .parquet"),
        ("rows.csv", b"success,goal_x\n1,0.6,3\n", "Expected 2 columns, got 3"),
        ("rows.csv", b"success;goal_x\n1;0,6\n", "Expected 1 columns, got 2"),
        ("rows.csv", b"success;goal_x\n1;0.6\n", "unknown column success;goal_x"),
        ("rows.parquet", b"text", "cannot read .* as parquet"),
        ("none.csv", None, "cannot read .*none.csv"),
    ],
)
def test_a_file_without_valid_rows_is_rejected(
    name: str, content: bytes | None, message: str, library: ExperienceLibrary, tmp_path: Path
) -> None:
    path = tmp_path / name
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(LibraryError, match=message):
        add_file(library, path, source="lab")


def test_missing_values_have_defaults() -> None:
    first, second = check_rows([{**GOOD, "final_x": ""}, {**GOOD, "final_x": "0.5"}], PLANE, "lab")
    assert (first["success"], first["goal_x"], first["base_y"]) == (True, 0.6, 0.0)
    assert first["start_x"] == PLANE.task.start_line.x_m
    assert np.isnan(first["final_x"]) and second["final_x"] == 0.5


def test_each_row_without_an_environment_gets_its_own() -> None:
    rows = [{**GOOD, "environment": number} for number in [3, None, "", 3, 7]]
    environment = [row["environment"] for row in check_rows(rows, PLANE, "lab")]
    assert [environment[i] for i in (0, 3, 4)] == [3, 3, 7]
    assert len(set(environment)) == 4


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"success": "yes"}, "row 2: success is yes; it must be true or false"),
        ({"success": ""}, "row 2: success is ; it must be true"),
        ({"goal_x": "far"}, "row 2: goal_x is far; it must be a number in m up to 1e"),
        ({"goal_x": "nan"}, "row 2: goal_x is nan"),
        ({"goal_x": "1e300"}, "row 2: goal_x is 1e300"),
        ({"final_x": "inf"}, "row 2: final_x is inf"),
        ({"goal_x": 1.9}, r"row 2: the goal .* the arm reaches .* choose a nearer goal, or leave"),
        ({"start_phi": 60}, "row 2: start_phi is 60, .* from -3.1416 to 3.1416 rad, not degrees"),
        ({"start_y": 0.5}, r"row 2: start_y is 0.5, .* from -0.42 to 0.42 m .* leave the row"),
        ({"environment": 1.5}, "row 2: environment is 1.5; it must be a whole number"),
        ({"start_qx": 0.0}, "unknown column start_qx; rows of cylinder-clutter need success, goal"),
    ],
)
def test_invalid_rows_are_rejected_with_row_value_and_limit(
    change: dict[str, object], message: str
) -> None:
    with pytest.raises(LibraryError, match=message):
        check_rows([GOOD, {**GOOD, **change}], PLANE, "lab")


def test_a_missing_column_is_named() -> None:
    rows = [{key: value for key, value in GOOD.items() if key != "start_phi"}]
    with pytest.raises(LibraryError, match=r"lab lacks the column start_phi; rows .* need success"):
        check_rows(rows, PLANE, "lab")


def test_a_movable_base_is_required_and_shifts_the_start_line() -> None:
    scenario = load_scenario("cylinder-aperture-clutter")
    with pytest.raises(LibraryError, match="lacks the column base_y"):
        check_rows([GOOD], scenario, "lab")
    shifted = {**GOOD, "goal_y": 0.6, "start_y": 0.5, "base_y": 0.5}
    assert check_rows([shifted], scenario, "lab")[0]["base_y"] == 0.5
    with pytest.raises(LibraryError, match=r"start_y is -0.5, .* m from the base"):
        check_rows([{**shifted, "start_y": 0.0}], scenario, "lab")


def test_rows_of_the_pr2_need_torso_and_unit_quaternion() -> None:
    scenario = load_scenario("sphere-aperture-clutter")
    (row,) = check_rows([SPACE], scenario, "lab")
    assert [row[f"start_q{axis}"] for axis in "wxyz"] == [1.0, 0.0, 0.0, 0.0]
    with pytest.raises(
        LibraryError, match=r"row 1: the length of the quaternion .* from 0.999 to 1.001"
    ):
        check_rows([{**SPACE, "start_qx": 0.5}], scenario, "lab")
    with pytest.raises(LibraryError, match="lacks the column torso"):
        check_rows([{k: v for k, v in SPACE.items() if k != "torso"}], scenario, "lab")
