import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from support.fake_reach import comparable, make_record, make_request

from lic_drake.errors import LibraryError, RequestError
from lic_drake.experience.collect import REQUEST_FILE, write_request
from lic_drake.experience.store import COMPACTED, ExperienceLibrary, Share, merge_libraries
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


def test_pandas_opens_the_folder_even_during_a_collection(
    library: ExperienceLibrary,
) -> None:
    write_request(REQUEST, library.path / REQUEST_FILE)
    with library.locked():
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
    assert library.successes() == {record.key: record.success for record in expected}
    assert library.scenario() == SCENARIO
    columns = library.columns()
    assert columns["success"].dtype == bool
    assert columns["goal_x"].dtype == np.float64
    np.testing.assert_array_equal(columns["environment"], [r.environment for r in expected])
    assert {array.shape for array in columns.values()} == {(len(expected),)}


def names(library: ExperienceLibrary) -> list[str]:
    return sorted(path.name for path in library.path.iterdir())


def test_compacting_merges_shards_without_duplicates_and_is_idempotent(
    library: ExperienceLibrary,
) -> None:
    library.write_shard("new", [*RECORDS[2], RECORDS[0][3]], SCENARIO)
    library.compact()
    assert names(library) == [f"{COMPACTED}.parquet"]
    expected = RECORDS[0] + RECORDS[1] + RECORDS[2]
    assert sorted(comparable(library.records())) == sorted(comparable(expected))
    assert library.scenario() == SCENARIO
    # Rows are grouped by environment.
    assert list(library.columns()["environment"]) == sorted(r.environment for r in expected)
    content = library.shard_path(COMPACTED).read_bytes()
    library.compact()
    assert library.shard_path(COMPACTED).read_bytes() == content


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


def test_missing_and_empty_libraries_are_reported(tmp_path: Path) -> None:
    with pytest.raises(LibraryError, match=r"no experience library at .*; make one with: lic"):
        ExperienceLibrary(tmp_path / "none").successes()
    empty = ExperienceLibrary(tmp_path)
    assert (empty.successes(), empty.num_reaches) == ({}, 0)
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


def test_shards_are_plain_files_in_the_folder(library: ExperienceLibrary) -> None:
    for name in ("../escape", "a/b", "_hidden", ".hidden", ""):
        with pytest.raises(LibraryError, match="cannot be a shard's name"):
            library.write_shard(name, RECORDS[0], SCENARIO)


def test_a_folder_without_write_permission_is_one_clear_error(
    library: ExperienceLibrary,
) -> None:
    before = sorted(library.path.iterdir())
    library.path.chmod(0o555)
    # Root may write anywhere, so run as nobody.
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


def test_merging_keeps_every_reach_once_in_order(
    tmp_path: Path, library: ExperienceLibrary
) -> None:
    other, output = ExperienceLibrary(tmp_path / "other"), tmp_path / "new" / "all.parquet"
    other.write_shard("a", RECORDS[2], SCENARIO)
    other.write_shard("b", [replace(r, wall_time_s=-1.0) for r in RECORDS[1]], SCENARIO)
    assert merge_libraries([other, library], output) == 36
    merged = ExperienceLibrary(output)
    assert comparable(merged.records()) == comparable(RECORDS[0] + RECORDS[1] + RECORDS[2])
    assert merged.scenario() == SCENARIO
    with pytest.raises(LibraryError, match=r"all\.parquet exists; delete it or choose another"):
        merge_libraries([other], output)
    with pytest.raises(LibraryError, match=r"needs the suffix \.parquet"):
        merge_libraries([other], tmp_path / "all")


def test_contradictions_and_different_scenarios_are_not_merged(
    tmp_path: Path, library: ExperienceLibrary
) -> None:
    other = ExperienceLibrary(tmp_path / "other")
    other.write_shard("a", [replace(RECORDS[1][4], duration_s=1.0)], SCENARIO)
    with pytest.raises(LibraryError, match=f"another result of reach {RECORDS[1][4].key}"):
        merge_libraries([library, other], tmp_path / "all.parquet")
    scenario = load_scenario("cylinder-clutter", "{stop: {timeout_s: 20}}")
    strange = ExperienceLibrary(tmp_path / "strange")
    strange.write_shard("a", [replace(RECORDS[0][0], scenario=scenario.digest)], scenario)
    with pytest.raises(LibraryError, match=f"strange holds scenario {scenario.digest}, but"):
        merge_libraries([library, strange], tmp_path / "all.parquet")
    assert not (tmp_path / "all.parquet").exists()


def test_only_shares_of_the_same_collection_may_hold_locks_concurrently(
    library: ExperienceLibrary,
) -> None:
    with library.locked(Share(1, 2)), library.locked(Share(2, 2)):
        for share in (Share(1, 2), Share(), Share(1, 3)):
            with pytest.raises(LibraryError, match="another process is adding to"):
                with library.locked(share):
                    pass
    with library.locked():
        pass


def test_a_share_is_every_nth_environment() -> None:
    assert [list(Share(k, 3).of(range(5, 12))) for k in (1, 2, 3)] == [[5, 8, 11], [6, 9], [7, 10]]
    assert Share.parse("2/3") == Share(2, 3)
    for text in ("0/3", "4/3", "1", "a/b", "-1/3"):
        with pytest.raises(RequestError, match="a share is k/n with k from 1 to n"):
            Share.parse(text)
