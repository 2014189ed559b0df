import os
import signal
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from support.fake_reach import comparable, make_record, make_request

from lic_drake.errors import LibraryError
from lic_drake.experience.collect import REQUEST_FILE, write_request
from lic_drake.experience.store import ExperienceLibrary, merge_libraries
from lic_drake.reach.scenario import load_scenario

REQUEST = make_request()
SCENARIO = REQUEST.scenario
OTHER = load_scenario("cylinder-clutter", "{stop: {timeout_s: 20}}")
RECORDS = [[make_record(item) for item in REQUEST.reaches(e)] for e in range(3)]


@pytest.fixture
def library(tmp_path: Path) -> ExperienceLibrary:
    library = ExperienceLibrary(tmp_path / "library")
    for environment in range(2):
        library.write_shard(f"training-{environment}", RECORDS[environment], SCENARIO)
    return library


def test_pandas_opens_the_folder_even_during_a_collection(library: ExperienceLibrary) -> None:
    write_request(REQUEST, library.path / REQUEST_FILE)
    with library.locked():
        (library.path / ".training-2.parquet.tmp").write_bytes(b"half a shard")
        frame = pd.read_parquet(library.path)
    expected = RECORDS[0] + RECORDS[1]
    assert list(frame["key"]) == [record.key for record in expected]
    np.testing.assert_array_equal(frame["peak_force"], [r.peak_force for r in expected])
    assert [tuple(q) for q in frame["q_final"]][:5] == [r.q_final for r in expected][:5]


def test_rows_columns_keys_and_scenario_are_what_was_written(library: ExperienceLibrary) -> None:
    expected = RECORDS[0] + RECORDS[1]
    assert comparable(library.records()) == comparable(expected)
    assert library.successes() == {record.key: record.success for record in expected}
    assert library.scenario() == SCENARIO
    assert library.num_reaches == len(expected)
    columns = library.columns()
    assert (columns["success"].dtype, columns["goal_x"].dtype) == (bool, np.float64)
    np.testing.assert_array_equal(columns["environment"], [r.environment for r in expected])


def names(library: ExperienceLibrary) -> list[str]:
    return sorted(path.name for path in library.path.iterdir())


def test_compacting_merges_shards_without_duplicates(library: ExperienceLibrary) -> None:
    library.write_shard("new", [*RECORDS[2], RECORDS[0][3]], SCENARIO)
    library.compact()
    assert names(library) == ["reaches.parquet"]
    expected = RECORDS[0] + RECORDS[1] + RECORDS[2]
    assert sorted(comparable(library.records())) == sorted(comparable(expected))
    assert library.scenario() == SCENARIO
    # Rows are grouped by environment.
    assert list(library.columns()["environment"]) == sorted(r.environment for r in expected)


def test_a_kill_between_writing_and_deleting_loses_nothing(
    library: ExperienceLibrary, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = comparable(library.records())
    with monkeypatch.context() as patch:
        patch.setattr(Path, "unlink", lambda path: signal.raise_signal(signal.SIGINT))
        with pytest.raises(KeyboardInterrupt):
            library.compact()
    assert len(names(library)) == 3
    library.compact()
    assert names(library) == ["reaches.parquet"]
    assert sorted(comparable(library.records())) == sorted(before)


def test_missing_and_empty_libraries_are_reported(tmp_path: Path) -> None:
    with pytest.raises(LibraryError, match=r"no experience library at .*; make one with: lic"):
        ExperienceLibrary(tmp_path / "none").successes()
    empty = ExperienceLibrary(tmp_path)
    assert empty.successes() == {}
    with pytest.raises(LibraryError, match="holds no reaches yet"):
        empty.columns()


def test_shards_of_different_scenarios_do_not_mix(library: ExperienceLibrary) -> None:
    with pytest.raises(LibraryError, match=f"do not belong to scenario {OTHER.digest}"):
        library.write_shard("other", RECORDS[2], OTHER)
    library.write_shard("other", [replace(r, scenario=OTHER.digest) for r in RECORDS[2]], OTHER)
    with pytest.raises(LibraryError, match="hold different scenarios"):
        library.records()


def test_a_folder_without_write_permission_is_one_clear_error(library: ExperienceLibrary) -> None:
    before = sorted(library.path.iterdir())
    library.path.chmod(0o555)
    user = os.geteuid()
    if user == 0:  # Root may write anywhere, so run as nobody.
        os.seteuid(65534)
    try:
        with pytest.raises(LibraryError, match="Permission denied; check free space and perm"):
            library.write_shard("training-2", RECORDS[2], SCENARIO)
    finally:
        os.seteuid(user)
        library.path.chmod(0o755)
    assert sorted(library.path.iterdir()) == before


def test_merging_keeps_every_reach_once_and_refuses_contradictions(
    tmp_path: Path, library: ExperienceLibrary
) -> None:
    other, output = ExperienceLibrary(tmp_path / "other"), tmp_path / "new" / "all.parquet"
    other.write_shard("a", RECORDS[2], SCENARIO)
    other.write_shard("b", [replace(r, wall_time_s=-1.0) for r in RECORDS[1]], SCENARIO)
    assert merge_libraries([other, library], output) == 36
    merged = ExperienceLibrary(output)
    assert comparable(merged.records()) == comparable(RECORDS[0] + RECORDS[1] + RECORDS[2])
    assert merged.scenario() == SCENARIO
    wrong, strange = ExperienceLibrary(tmp_path / "wrong"), ExperienceLibrary(tmp_path / "strange")
    wrong.write_shard("a", [replace(RECORDS[1][4], duration_s=1.0)], SCENARIO)
    strange.write_shard("a", [replace(RECORDS[0][0], scenario=OTHER.digest)], OTHER)
    for source, path, message in (
        (other, output, r"exists, or does not end in \.parquet; delete it"),
        (wrong, tmp_path / "all.parquet", f"another result of reach {RECORDS[1][4].key}"),
        (strange, tmp_path / "all.parquet", f"strange holds reaches of scenario {OTHER.digest}"),
    ):
        with pytest.raises(LibraryError, match=message):
            merge_libraries([library, source], path)
    assert not (tmp_path / "all.parquet").exists()


def test_only_shares_of_the_same_collection_may_hold_locks_concurrently(
    library: ExperienceLibrary,
) -> None:
    with library.locked("1/2"), library.locked("2/2"):
        for share in ("1/2", "1/1", "1/3"):
            with pytest.raises(LibraryError, match="another process is adding to"):
                with library.locked(share):
                    pass
    with library.locked():
        pass
