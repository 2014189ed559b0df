import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from support.fake_reach import fill_library

from lic_drake.errors import LibraryError
from lic_drake.experience.add import add_rows, check_rows, read_rows
from lic_drake.experience.check import check_library
from lic_drake.experience.collect import REQUEST_FILE, read_request
from lic_drake.experience.pairs import pair_reaches
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.reach.scenario import load_scenario

GOOD = {"success": "true", "goal_x": "0.6", "goal_y": 0.1, "start_y": 0.0, "start_phi": 1.0}
ROWS = [{**GOOD, "success": i % 2 == 0, "start_y": 0.1 * i} for i in range(4)]
SPACE = {
    **{"success": True, "goal_x": 0.84, "goal_y": -0.29, "goal_z": 0.89},
    **{"start_x": 0.53, "start_y": -0.29, "start_z": 0.89, "base_y": 0.0, "torso": 0.15},
}
PLANE, TRACK, BOARD = (
    load_scenario(name)
    for name in ("cylinder-clutter", "cylinder-aperture-clutter", "sphere-aperture-clutter")
)


@pytest.fixture(scope="module")
def filled(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return fill_library(tmp_path_factory.mktemp("filled") / "library")


@pytest.fixture
def library(filled: Path, tmp_path: Path) -> ExperienceLibrary:
    return ExperienceLibrary(shutil.copytree(filled, tmp_path / "library"))


def test_rows_become_a_shard_with_their_source_and_weight(library: ExperienceLibrary) -> None:
    before = {path: path.read_bytes() for path in library.shard_paths()}
    records = add_rows(library, ROWS, source="lab", weight=4.0)
    assert [record.success for record in records] == [True, False, True, False]
    assert len(library.shard_paths()) == 4
    assert {path: path.read_bytes() for path in before} == before
    columns = library.columns()
    assert len(columns["key"]) == len(pd.read_parquet(library.path)) == 40
    labels = set(zip(columns["source"], columns["weight"], strict=True))
    assert labels == {("lab", 4.0), ("simulation", 1.0)}
    assert check_library(library, read_request(library.path / REQUEST_FILE))["is_sound"]


def test_csv_and_parquet_give_bitwise_identical_rows(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    rows = [{**row, "final_x": rng.random(), "goal_x": 0.5 + rng.random() / 10} for row in ROWS]
    pd.DataFrame(rows).to_csv(tmp_path / "a.csv", index=False)
    pd.DataFrame(rows).to_parquet(tmp_path / "a.parquet")
    for name in ("a.csv", "a.parquet"):
        assert repr(check_rows(read_rows(tmp_path / name), PLANE)) == repr(check_rows(rows, PLANE))


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
    with pytest.raises(LibraryError, match=r"these 4 rows were added before; .* delete"):
        add_rows(library, ROWS, source="other", weight=2.0)
    library.shard_path(first[0].stream).unlink()
    assert add_rows(library, ROWS, source="other", weight=2.0)[0].weight == 2.0


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"source": "simulation"}, "cannot be the name of a source"),
        ({"weight": float("nan")}, "from 0.001 to 1000 simulated reaches, got nan"),
        ({"rows": [*ROWS, {**ROWS[0], "goal_y": 9}]}, "row 5: the goal"),
        ({"rows": []}, "there are no rows"),
    ],
)
def test_a_rejected_addition_leaves_the_library_unchanged(
    values: dict[str, object], message: str, library: ExperienceLibrary
) -> None:
    arguments = {"rows": ROWS, "source": "lab", "weight": 1.0, **values}
    with pytest.raises(LibraryError, match=message):
        add_rows(library, arguments.pop("rows"), **arguments)
    assert len(library.shard_paths()) == 3


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("rows.txt", "", ".csv or .parquet"),
        ("rows.csv", "success,goal_x\n1,0.6,3\n", "Expected 2 columns, got 3"),
        ("rows.csv", "success,goal_x, goal_x\n1,0.6,0.7\n", "has 2 columns goal_x; keep one"),
        ("rows.parquet", "text", "cannot read .* as parquet"),
    ],
)
def test_a_file_without_rows_is_rejected(
    name: str, content: str, message: str, tmp_path: Path
) -> None:
    (tmp_path / name).write_text(content)
    with pytest.raises(LibraryError, match=message):
        read_rows(tmp_path / name)


def test_missing_values_have_defaults_and_rows_environments_of_their_own() -> None:
    rows = [{**GOOD, "environment": number, "final_x": ""} for number in [3, None, "", 3, 7]]
    checked = check_rows([*rows, {**GOOD, "final_x": "0.5"}], PLANE)
    first, last = checked[0], checked[-1]
    assert (first["success"], first["goal_x"], first["base_y"]) == (True, 0.6, 0.0)
    assert first["start_x"] == PLANE.task.start_line.x_m
    assert np.isnan(first["final_x"]) and last["final_x"] == 0.5
    environment = [row["environment"] for row in checked]
    assert [environment[i] for i in (0, 3, 4)] == [3, 3, 7]
    assert len(set(environment)) == 5


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"success": "yes"}, "row 2: success is yes, but must be a whole number from 0 to 1; corr"),
        ({"goal_x": "far"}, r"goal_x is far, but must be a number from -1e\+06 to 1e\+06 m;"),
        ({"goal_x": "nan"}, "goal_x is nan"),
        ({"goal_x": 1.9}, r"row 2: the goal .* the arm reaches .* choose a nearer goal; correct"),
        ({"start_phi": 60}, "start_phi is 60, but must be a number from -3.1416 to 3.1416 rad"),
        ({"start_y": 0.5}, r"start_y - base_y is 0.5, .* from -0.42 to 0.42; .* leave the row out"),
        ({"environment": 1.5}, "environment is 1.5, but must be a whole number"),
        ({"start_qx": 0.0}, "unknown column start_qx; rows of cylinder-clutter need success, goal"),
    ],
)
def test_invalid_rows_are_rejected_with_row_value_and_limit(
    change: dict[str, object], message: str
) -> None:
    with pytest.raises(LibraryError, match=message):
        check_rows([GOOD, {**GOOD, **change}], PLANE)


def test_each_robot_has_its_columns() -> None:
    shifted = {**GOOD, "goal_y": 0.6, "start_y": 0.5, "base_y": 0.5}
    assert check_rows([shifted], TRACK)[0]["base_y"] == 0.5
    (row,) = check_rows([SPACE], BOARD)
    assert [row[f"start_q{axis}"] for axis in "wxyz"] == [1.0, 0.0, 0.0, 0.0]
    for row, scenario, message in (
        (GOOD, TRACK, "missing column base_y; rows .* need success"),
        ({**shifted, "start_y": 0.0}, TRACK, "start_y - base_y is -0.5"),
        (SPACE | {"start_qx": 0.5}, BOARD, "the length of the quaternion .* from 0.999 to 1.001"),
        ({k: v for k, v in SPACE.items() if k != "torso"}, BOARD, "missing column torso"),
    ):
        with pytest.raises(LibraryError, match=message):
            check_rows([row], scenario)
