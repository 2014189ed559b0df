import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from support.fake_reach import comparable, make_record, make_request

from lic_drake.errors import LibraryError
from lic_drake.experience.grid import REQUEST_FILE, write_request
from lic_drake.experience.journal import Journal, journal_path
from lic_drake.experience.lock import CollectionLock
from lic_drake.experience.store import COMPACTED, ExperienceLibrary
from lic_drake.reach.scenario import load_scenario

REQUEST = make_request()
SCENARIO = REQUEST.scenario
RECORDS = [[make_record(item) for item in REQUEST.reaches(e)] for e in range(3)]


@pytest.fixture
def library(tmp_path: Path) -> ExperienceLibrary:
    library = ExperienceLibrary(tmp_path / "library")
    for environment in range(2):
        library.write_shard(f"training-{environment}", RECORDS[environment], SCENARIO)
    return library


def test_pandas_opens_the_folder_also_while_a_collection_is_at_work(
    library: ExperienceLibrary,
) -> None:
    write_request(REQUEST, library.path / REQUEST_FILE)
    with (
        CollectionLock(library.path),
        Journal(journal_path(library.shard_path("training-2"))) as journal,
    ):
        journal.append(RECORDS[2][0])
        (library.path / ".training-2.parquet.tmp").write_bytes(b"half a shard")
        frame = pd.read_parquet(library.path)
    expected = RECORDS[0] + RECORDS[1]
    assert len(frame) == library.num_reaches == len(expected)
    assert list(frame["key"]) == [record.key for record in expected]
    np.testing.assert_array_equal(frame["peak_force"], [r.peak_force for r in expected])
    assert [tuple(q) for q in frame["q_final"]][:5] == [r.q_final for r in expected][:5]


def test_rows_columns_keys_and_scenario_are_what_was_written(library: ExperienceLibrary) -> None:
    expected = RECORDS[0] + RECORDS[1]
    assert comparable(library.records()) == comparable(expected)
    assert library.keys() == {record.key for record in expected}
    assert library.scenario() == SCENARIO
    columns = library.columns()
    assert columns["success"].dtype == bool
    assert columns["goal_x"].dtype == np.float64
    np.testing.assert_array_equal(columns["environment"], [r.environment for r in expected])
    assert {array.shape for array in columns.values()} == {(len(expected),)}


def test_a_single_file_is_a_library_too(library: ExperienceLibrary) -> None:
    single = ExperienceLibrary(library.path / "training-1.parquet")
    assert comparable(single.records()) == comparable(RECORDS[1])


def test_writing_a_shard_again_replaces_it(library: ExperienceLibrary) -> None:
    library.write_shard("training-1", RECORDS[2], SCENARIO)
    assert comparable(library.records()) == comparable(RECORDS[0] + RECORDS[2])


def names(library: ExperienceLibrary) -> list[str]:
    return sorted(path.name for path in library.path.iterdir())


def test_compacting_makes_one_file_of_the_same_rows_and_is_safe_to_repeat(
    library: ExperienceLibrary,
) -> None:
    write_request(REQUEST, library.path / REQUEST_FILE)
    before = comparable(library.records())
    library.compact()
    assert names(library) == [REQUEST_FILE, f"{COMPACTED}.parquet"]
    assert sorted(comparable(library.records())) == sorted(before)
    content = library.shard_path(COMPACTED).read_bytes()
    library.compact()
    assert library.shard_path(COMPACTED).read_bytes() == content
    # With new rows beside it, also such that are there already.
    library.write_shard("new", [*RECORDS[2], RECORDS[0][3]], SCENARIO)
    library.compact()
    assert names(library) == [REQUEST_FILE, f"{COMPACTED}.parquet"]
    expected = RECORDS[0] + RECORDS[1] + RECORDS[2]
    assert sorted(comparable(library.records())) == sorted(comparable(expected))
    assert library.scenario() == SCENARIO
    # Rows of an environment stand together.
    assert list(library.columns()["environment"]) == sorted(r.environment for r in expected)


def test_a_kill_between_writing_and_deleting_loses_nothing(
    library: ExperienceLibrary, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = comparable(library.records())
    with monkeypatch.context() as patch:
        patch.setattr(Path, "unlink", lambda path: (_ for _ in ()).throw(KeyboardInterrupt))
        with pytest.raises(KeyboardInterrupt):
            library.compact()
    assert len(names(library)) == 3
    library.compact()
    assert names(library) == [f"{COMPACTED}.parquet"]
    assert sorted(comparable(library.records())) == sorted(before)


def test_compacting_leaves_alone_what_is_one_file_already(library: ExperienceLibrary) -> None:
    single = ExperienceLibrary(library.path / "training-1.parquet")
    before = names(library)
    single.compact()
    assert names(library) == before
    library.shard_path("training-0").unlink()
    library.compact()
    assert names(library) == ["training-1.parquet"]
    empty = ExperienceLibrary(library.path / "empty")
    empty.create()
    empty.compact()
    assert names(empty) == []


def test_libraries_of_two_scenarios_are_not_made_one(library: ExperienceLibrary) -> None:
    other = load_scenario("cylinder-clutter", "{stop: {timeout_s: 20}}")
    rows = [replace(record, scenario=other.digest) for record in RECORDS[2]]
    library.write_shard("other", rows, other)
    before = names(library)
    with pytest.raises(LibraryError, match="hold different scenarios"):
        library.compact()
    assert names(library) == before


def test_a_library_that_is_not_there_or_empty_says_how_to_make_one(tmp_path: Path) -> None:
    with pytest.raises(LibraryError, match=r"no experience library at .*; make one with: lic"):
        ExperienceLibrary(tmp_path / "none").keys()
    empty = ExperienceLibrary(tmp_path)
    assert (empty.keys(), empty.num_reaches) == (set(), 0)
    with pytest.raises(LibraryError, match="holds no reaches yet"):
        empty.columns()


def test_shards_of_different_scenarios_do_not_mix(library: ExperienceLibrary) -> None:
    other = load_scenario("cylinder-clutter", "{stop: {timeout_s: 20}}")
    with pytest.raises(LibraryError, match=f"do not belong to scenario {other.digest}"):
        library.write_shard("other", RECORDS[2], other)
    rows = [replace(record, scenario=other.digest) for record in RECORDS[2]]
    library.write_shard("other", rows, other)
    with pytest.raises(LibraryError, match="hold different scenarios"):
        library.records()


@pytest.mark.parametrize("name", ["../escape", "a/b", "_hidden", ".hidden", ""])
def test_a_shard_stays_in_the_folder_and_visible(library: ExperienceLibrary, name: str) -> None:
    with pytest.raises(LibraryError, match="cannot be a shard's name"):
        library.write_shard(name, RECORDS[0], SCENARIO)


def test_a_folder_without_write_permission_is_one_clear_error(
    library: ExperienceLibrary,
) -> None:
    before = sorted(library.path.iterdir())
    library.path.chmod(0o555)
    # Root may write anywhere, so the test becomes nobody for a moment.
    is_root = os.geteuid() == 0
    if is_root:
        os.seteuid(65534)
    try:
        with pytest.raises(LibraryError, match="Permission denied; check free space and perm"):
            library.write_shard("training-2", RECORDS[2], SCENARIO)
    finally:
        if is_root:
            os.seteuid(0)
        library.path.chmod(0o755)
    assert sorted(library.path.iterdir()) == before


def test_a_path_below_a_file_is_one_clear_error(library: ExperienceLibrary) -> None:
    below = ExperienceLibrary(library.path / "training-1.parquet" / "library")
    with pytest.raises(LibraryError, match=r"cannot create the folder .*: Not a directory"):
        below.write_shard("training-2", RECORDS[2], SCENARIO)
