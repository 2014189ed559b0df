import struct
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from support.trial_rows import make_rows

from lic_drake.errors import LibraryError
from lic_drake.evaluate.trials import SCHEMA, TrialRow, TrialTable, read_trials, write_trials

ROWS = make_rows("rnd", ["1", "01", "00"]) + make_rows("gp", ["01", "1", "1"], variant="other")


def bits(row: TrialRow) -> list[object]:
    """The values of a row, floats as bytes, so that NaNs compare."""
    return [struct.pack("d", v) if isinstance(v, float) else v for v in vars(row).values()]


def test_rows_come_back_bit_for_bit_in_their_order(tmp_path: Path) -> None:
    path = tmp_path / "new folder" / "trials.parquet"
    rows = [*ROWS[::-1], replace(ROWS[0], probability=0.1 + 0.2, seconds=1e-300)]
    write_trials(path, rows)
    assert list(map(bits, read_trials(path))) == list(map(bits, rows))
    assert [p.name for p in path.parent.iterdir()] == ["trials.parquet"]


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda path: None, r"cannot read .*trials\.parquet: No such file"),
        (lambda path: path.write_bytes(b"PAR1"), "damaged or not a Parquet file; delete it"),
        (lambda path: pq.write_table(pa.table({"x": [1]}), path), "no trials of version 1"),
        (lambda path: pq.write_table(other_version("2"), path), "no trials of version 1"),
        (lambda path: pq.write_table(other_version("1", 3), path), "no trials of version 1"),
    ],
)
def test_other_files_are_refused(tmp_path: Path, make: Callable[[Path], object], said: str) -> None:
    make(tmp_path / "trials.parquet")
    with pytest.raises(LibraryError, match=said):
        read_trials(tmp_path / "trials.parquet")


def other_version(version: str, columns: int | None = None) -> pa.Table:
    schema = pa.schema(list(SCHEMA)[:columns])
    return schema.with_metadata({"lic_drake.trials_version": version}).empty_table()


def test_a_folder_that_cannot_be_made_is_one_clear_error(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(LibraryError, match="cannot create the folder"):
        write_trials(tmp_path / "file" / "trials.parquet", ROWS)


def test_trials_are_sorted_runs_of_attempts() -> None:
    rows = make_rows("gp", ["001", "1", "01", "000"], goals=2)
    table = TrialTable([*rows[::-1], *make_rows("rnd", ["1"] * 4, goals=2)])
    trials = table.trials("gp")
    assert list(trials) == [(0, 0), (0, 1), (1, 0), (1, 1)] == table.pairs()
    found = [[row.attempt for row in attempts] for attempts in trials.values()]
    assert found == [[1, 2, 3], [1], [1, 2], [1, 2, 3]]
    assert (table.max_attempts("gp"), table.max_attempts("rnd")) == (3, 1)
    assert table.success("gp", 1).tolist() == [False, True, False, False]
    assert table.success("gp", 2).tolist() == [False, True, True, False]
    assert [table.conditional("gp", k) for k in (1, 2, 3)] == [(1, 4), (1, 3), (1, 2)]


def test_variants_are_kept_apart() -> None:
    table = TrialTable(ROWS)
    assert table.variants == ("", "other")
    assert (table.methods(), table.methods("other")) == (("rnd",), ("gp",))
    assert table.success("gp", 1, "other").tolist() == [False, True, True]
    assert table.conditional("gp", 2, "other") == (1, 1)


def test_trials_that_cannot_be_compared_are_refused() -> None:
    table = TrialTable(make_rows("gp", ["1"] * 4, goals=2) + make_rows("rnd", ["1"] * 3, goals=2))
    with pytest.raises(LibraryError, match=r"gp and rnd .* goal 1 of environment 1"):
        table.success("rnd", 1)
    table = TrialTable(make_rows("gp", ["1", "0"]))
    with pytest.raises(LibraryError, match="gp made 1 of 2 attempts; evaluate with more"):
        table.success("gp", 2)
    with pytest.raises(LibraryError, match=r"no trials of knn; there are rnd, gp \(other\)"):
        TrialTable(ROWS).trials("knn")


@pytest.mark.parametrize(
    "rows",
    [
        make_rows("gp", ["01"]) * 2,
        make_rows("gp", ["11"]),
        make_rows("gp", ["001"])[::2],
    ],
    ids=["twice", "after a success", "with a gap"],
)
def test_impossible_runs_of_attempts_are_refused(rows: list[TrialRow]) -> None:
    with pytest.raises(LibraryError, match="of gp in environment 0 at goal 0"):
        TrialTable(rows)


def test_a_reach_that_was_only_believed_to_succeed_ends_a_trial_without_success() -> None:
    table = TrialTable(make_rows("gp", ["1", "01", "0", "00"]))
    assert table.success("gp", 2).tolist() == [True, True, False, False]
    assert table.conditional("gp", 2) == (1, 2)
