from dataclasses import replace
from pathlib import Path

import pytest
from support.fake_reach import comparable, expected_records, make_record, make_request

from lic_drake.errors import LibraryError
from lic_drake.experience.merge import merge_libraries
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.reach.scenario import load_scenario

REQUEST = make_request()
SCENARIO = REQUEST.scenario
RECORDS = [[make_record(item) for item in REQUEST.reaches(e)] for e in range(3)]


@pytest.fixture
def libraries(tmp_path: Path) -> list[ExperienceLibrary]:
    """Two libraries that share environment 1; the second one's shards are not in order."""
    first, second = ExperienceLibrary(tmp_path / "first"), ExperienceLibrary(tmp_path / "second")
    first.write_shard("a", RECORDS[2], SCENARIO)
    first.write_shard("b", RECORDS[1], SCENARIO)
    second.write_shard("a", [replace(r, wall_time_s=-1.0) for r in RECORDS[1]], SCENARIO)
    second.write_shard("b", RECORDS[0], SCENARIO)
    return [first, second]


def test_merging_keeps_every_reach_once_in_order(
    tmp_path: Path, libraries: list[ExperienceLibrary]
) -> None:
    output = tmp_path / "new" / "all.parquet"
    assert merge_libraries(libraries, output) == 36
    merged = ExperienceLibrary(output)
    assert comparable(merged.records()) == expected_records(REQUEST)
    assert merged.scenario() == SCENARIO


def test_contradicting_results_are_refused(
    tmp_path: Path, libraries: list[ExperienceLibrary]
) -> None:
    changed = [replace(RECORDS[1][4], duration_s=1.0)]
    libraries[1].write_shard("a", changed, SCENARIO)
    with pytest.raises(LibraryError, match=f"another result of reach {RECORDS[1][4].key}"):
        merge_libraries(libraries, tmp_path / "all.parquet")
    assert not (tmp_path / "all.parquet").exists()


def test_different_scenarios_are_refused(
    tmp_path: Path, libraries: list[ExperienceLibrary]
) -> None:
    other = load_scenario("cylinder-clutter", "{stop: {timeout_s: 20}}")
    strange = ExperienceLibrary(tmp_path / "strange")
    strange.write_shard("a", [replace(r, scenario=other.digest) for r in RECORDS[0]], other)
    with pytest.raises(LibraryError, match=f"strange holds scenario {other.digest}, but .*first"):
        merge_libraries([*libraries, strange], tmp_path / "all.parquet")


def test_an_existing_file_or_a_folders_name_is_refused(
    tmp_path: Path, libraries: list[ExperienceLibrary]
) -> None:
    with pytest.raises(LibraryError, match=r"a\.parquet exists; delete it or choose another"):
        merge_libraries(libraries, libraries[0].path / "a.parquet")
    with pytest.raises(LibraryError, match=r"needs the suffix \.parquet"):
        merge_libraries(libraries, tmp_path / "all")
