import math
import struct
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.trial_rows import make_rows

from lic_drake.errors import LibraryError
from lic_drake.evaluate.trials import SCHEMA, TrialRow, TrialTable, read_trials, write_trials

ROWS = make_rows("rnd", ["1", "01", "00"]) + make_rows("gp", ["01", "1", "1"], variant="fresh")


def bits(rows: list[TrialRow]) -> list[tuple[object, ...]]:
    """The values of rows, floats as bytes, so that NaNs compare."""
    return [
        tuple(struct.pack("d", v) if isinstance(v, float) else v for v in vars(row).values())
        for row in rows
    ]


def test_rows_come_back_bit_for_bit_in_their_order(tmp_path: Path) -> None:
    path = tmp_path / "new folder" / "trials.parquet"
    rows = [*ROWS[::-1], replace(ROWS[0], probability=0.1 + 0.2, seconds=1e-300)]
    write_trials(path, rows)
    assert bits(read_trials(path)) == bits(rows)
    assert [p.name for p in path.parent.iterdir()] == ["trials.parquet"]


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda path: None, r"cannot read .*trials\.parquet: No such file"),
        (lambda path: path.write_bytes(b"PAR1"), "damaged or not a Parquet file; delete it"),
        (lambda path: pq.write_table(pa.table({"x": [1]}), path), "no trials of version 1"),
        (lambda path: pq.write_table(other_version("2"), path), "no trials of version 1"),
        (
            lambda path: pq.write_table(other_version("1", SCHEMA.names[:-1]), path),
            "no trials of version 1",
        ),
    ],
    ids=["missing", "damaged", "other table", "other version", "other columns"],
)
def test_other_files_are_refused(tmp_path: Path, make: Callable[[Path], object], said: str) -> None:
    make(tmp_path / "trials.parquet")
    with pytest.raises(LibraryError, match=said):
        read_trials(tmp_path / "trials.parquet")


def other_version(version: str, names: Sequence[str] = SCHEMA.names) -> pa.Table:
    schema = pa.schema([SCHEMA.field(name) for name in names])
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


@given(st.lists(st.sampled_from(["1", "01", "001", "000"]), min_size=1))
def test_conditional_rates_chain_to_the_total(outcomes: list[str]) -> None:
    table = TrialTable(make_rows("gp", outcomes, goals=3))
    failure = math.prod(
        1.0 - result.rate
        for result in (table.conditional("gp", k) for k in (1, 2, 3))
        if result.trials
    )
    assert table.success("gp", 3).mean() == pytest.approx(1.0 - failure)
    by_hand = [any(digit == "1" for digit in text) for text in outcomes]
    np.testing.assert_array_equal(table.success("gp", 3), by_hand)


def test_variants_are_kept_apart() -> None:
    rows = make_rows("gp", ["1", "00"]) + make_rows("gp", ["01", "1", "1"], variant="fresh")
    table = TrialTable(rows + make_rows("rnd", ["01", "1"]))
    assert table.variants == ("", "fresh")
    assert table.methods() == ("gp", "rnd")
    assert table.methods("fresh") == ("gp",)
    assert table.success("gp", 1).tolist() == [True, False]
    assert table.success("gp", 1, "fresh").tolist() == [False, True, True]
    assert table.conditional("gp", 2, "fresh") == (1, 1)
    assert (len(table.pairs()), len(table.pairs("fresh"))) == (2, 3)


def test_trials_that_cannot_be_compared_are_refused() -> None:
    table = TrialTable(make_rows("gp", ["1"] * 4, goals=2) + make_rows("rnd", ["1"] * 3, goals=2))
    with pytest.raises(LibraryError, match=r"gp and rnd .* goal 1 of environment 1"):
        table.success("rnd", 1)
    table = TrialTable(make_rows("gp", ["1", "01", "0"]))
    with pytest.raises(LibraryError, match="gp made 1 of 2 attempts at goal 0 of environment 2"):
        table.success("gp", 2)
    with pytest.raises(LibraryError, match=r"no trials of knn; there are rnd, gp \(fresh\)"):
        TrialTable(ROWS).trials("knn")


@pytest.mark.parametrize(
    "rows",
    [
        make_rows("gp", ["01"]) * 2,
        make_rows("gp", ["01"])[1:],
        make_rows("gp", ["11"]),
        make_rows("gp", ["001"])[::2],
    ],
    ids=["twice", "without the first", "after a success", "with a gap"],
)
def test_impossible_runs_of_attempts_are_refused(rows: list[TrialRow]) -> None:
    with pytest.raises(LibraryError, match="of gp in environment 0 at goal 0"):
        TrialTable(rows)
