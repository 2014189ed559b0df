import csv
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from support.fake_reach import fill_library

from lic_drake.errors import LibraryError
from lic_drake.experience.added import (
    FOLDER,
    add_file,
    add_records,
    added_columns,
    additions,
    read_columns,
)
from lic_drake.experience.check import check_library
from lic_drake.experience.grid import REQUEST_FILE, read_request
from lic_drake.experience.second_reach import pair_reaches
from lic_drake.experience.store import ExperienceLibrary

ROWS = [
    {"success": i % 2 == 0, "goal_x": 0.6, "goal_y": 0.1, "start_y": 0.1 * i, "start_phi": 1.0}
    for i in range(4)
]


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


def test_additions_lie_beside_the_simulated_reaches_which_stay_as_they_are(
    library: ExperienceLibrary,
) -> None:
    before = {path.name: path.read_bytes() for path in library.shard_paths()}
    addition = add_records(library, ROWS, source="lab", weight=4.0)
    assert (addition.records, addition.successes, addition.weight) == (4, 2, 4.0)
    assert addition.path.parent == library.path / FOLDER
    assert {path.name: path.read_bytes() for path in library.shard_paths()} == before
    assert len(library.columns()["key"]) == len(pd.read_parquet(library.path)) == 36
    report = check_library(library, read_request(library.path / REQUEST_FILE))
    assert report.is_sound and report.added == 4
    assert additions(library) == (addition,)


def test_csv_and_parquet_give_the_same_columns_bit_for_bit(
    library: ExperienceLibrary, tmp_path: Path
) -> None:
    rng = np.random.default_rng(0)
    rows = [{**row, "final_x": rng.random(), "goal_x": 0.5 + rng.random() / 10} for row in ROWS]
    text = add_file(library, write_csv(tmp_path / "a.csv", rows), source="lab")
    assert text.origin == "a.csv"
    from_text = read_columns(text.path)
    text.path.unlink()
    pd.DataFrame(rows).to_parquet(tmp_path / "a.parquet")
    columns = read_columns(add_file(library, tmp_path / "a.parquet", source="lab").path)
    for name in columns:
        assert from_text[name].tobytes() == columns[name].tobytes(), name
    assert columns["goal_x"].tolist() == [row["goal_x"] for row in rows]


def test_all_additions_are_read_with_their_weights_and_keep_their_places_apart(
    library: ExperienceLibrary,
) -> None:
    assert added_columns(library) is None
    add_records(library, ROWS, source="arm-1", weight=2.0)
    add_records(library, ROWS[:2], source="arm-2", weight=0.5)
    columns = added_columns(library)
    assert columns is not None
    assert sorted(columns["weight"]) == [0.5, 0.5, 2.0, 2.0, 2.0, 2.0]
    places = set(zip(columns["stream"], columns["environment"], strict=True))
    assert len(places) == 6


def test_failed_reaches_whose_end_was_recorded_become_first_reaches_of_pairs(
    library: ExperienceLibrary,
) -> None:
    end = {f"final_{name}": 0.1 for name in ("x", "y", "phi", "vx", "vy")}
    rows = [{**row, **(end if i else {}), "environment": 5} for i, row in enumerate(ROWS)]
    add_records(library, rows, source="lab", weight=3.0)
    columns = added_columns(library)
    assert columns is not None
    pairs = pair_reaches(columns)
    assert len(pairs["success"]) == 2 * 4  # Rows 1 and 3 failed, each is followed by all four.
    assert set(pairs["weight"]) == {3.0}


def test_the_same_records_are_not_added_twice_whatever_they_are_called(
    library: ExperienceLibrary,
) -> None:
    first = add_records(library, ROWS, source="lab")
    with pytest.raises(
        LibraryError, match=f"4 records are in .*{first.path.name} already; .* delete"
    ):
        add_records(library, ROWS, source="other", weight=2.0)
    first.path.unlink()
    assert add_records(library, ROWS, source="other", weight=2.0).weight == 2.0


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"source": "../lab"}, "cannot be the name of a source"),
        ({"source": ""}, "cannot be the name of a source"),
        ({"weight": 0.0}, "from 0.001 to 1000 simulated reaches, got 0"),
        ({"weight": float("nan")}, "got nan"),
        ({"rows": [*ROWS, {**ROWS[0], "goal_y": 9}]}, "row 5: the goal"),
    ],
)
def test_what_is_refused_leaves_the_folder_as_it_was(
    values: dict[str, object], said: str, library: ExperienceLibrary
) -> None:
    arguments = {"rows": ROWS, "source": "lab", "weight": 1.0, **values}
    with pytest.raises(LibraryError, match=said):
        add_records(library, arguments.pop("rows"), **arguments)
    assert not (library.path / FOLDER).exists()


def test_a_single_file_has_no_place_for_additions(library: ExperienceLibrary) -> None:
    single = ExperienceLibrary(library.shard_paths()[0])
    assert added_columns(single) is None
    with pytest.raises(LibraryError, match=r"single file.* into a folder of its own"):
        add_records(single, ROWS, source="lab")


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("rows.txt", "", ".csv or .parquet"),
        ("rows.csv", "success,goal_x\n1,0.6,3\n", "more values than columns"),
        ("rows.csv", b"\xff\xfe\x00", "cannot read"),
        ("rows.parquet", "text", "cannot read"),
        ("rows.csv", "", "holds 0 records"),
    ],
)
def test_a_file_that_holds_no_records_is_refused(
    name: str, content: str | bytes, said: str, library: ExperienceLibrary, tmp_path: Path
) -> None:
    path = tmp_path / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(LibraryError, match=said):
        add_file(library, path, source="lab")
    with pytest.raises(LibraryError, match="no file at"):
        add_file(library, tmp_path / "none.csv", source="lab")


def test_damage_and_strange_files_are_found(library: ExperienceLibrary) -> None:
    path = add_records(library, ROWS, source="lab").path
    whole = path.read_bytes()
    path.write_bytes(whole[:-20])
    report = check_library(library)
    assert [file.name for file in report.damaged] == [f"{FOLDER}/{path.name}"]
    with pytest.raises(LibraryError, match="damaged or not a Parquet file; delete it and add"):
        added_columns(library)
    shutil.copy(library.shard_paths()[0], path)
    with pytest.raises(LibraryError, match="holds no records that this lic_drake"):
        added_columns(library)


def test_records_of_another_category_are_refused(
    library: ExperienceLibrary, tmp_path: Path
) -> None:
    from lic_drake.paths import shipped_library

    add_records(library, ROWS, source="lab")
    other = ExperienceLibrary(
        shutil.copytree(shipped_library("passage-clutter"), tmp_path / "other")
    )
    shutil.copytree(library.path / FOLDER, other.path / FOLDER)
    with pytest.raises(
        LibraryError, match="holds records of cylinder-clutter, its library passage"
    ):
        added_columns(other)
