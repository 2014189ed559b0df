from dataclasses import replace
from pathlib import Path

import pytest
from support.fake_reach import make_record, make_request

from lic_drake.errors import LibraryError
from lic_drake.experience.check import check_library
from lic_drake.experience.journal import Journal, journal_path
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.reach.scenario import load_scenario

REQUEST = make_request()
RECORDS = [[make_record(item) for item in REQUEST.reaches(e)] for e in range(3)]


@pytest.fixture
def library(tmp_path: Path) -> ExperienceLibrary:
    library = ExperienceLibrary(tmp_path / "library")
    for environment in range(3):
        library.write_shard(f"shard-{environment}", RECORDS[environment], REQUEST.scenario)
    return library


def test_a_complete_library_is_sound(library: ExperienceLibrary) -> None:
    report = check_library(library, REQUEST)
    assert (report.shards, report.reaches, report.requested, report.missing) == (3, 36, 36, 0)
    assert report.incomplete == ()
    assert report.scenarios == (REQUEST.scenario.digest,)
    assert report.is_sound


def test_without_a_request_completeness_stays_open(library: ExperienceLibrary) -> None:
    report = check_library(library)
    assert (report.requested, report.missing, report.incomplete) == (None, None, ())
    assert report.is_sound


def test_missing_reaches_are_counted_also_when_they_are_in_a_journal(
    library: ExperienceLibrary,
) -> None:
    library.shard_path("shard-1").unlink()
    with Journal(journal_path(library.shard_path("shard-1"))) as journal:
        journal.append(RECORDS[1][0])
    report = check_library(library, REQUEST)
    assert (report.missing, report.journalled, report.incomplete) == (12, 1, (1,))
    assert not report.is_sound


def test_a_journal_that_a_kill_left_beside_its_shard_adds_nothing(
    library: ExperienceLibrary,
) -> None:
    with Journal(journal_path(library.shard_path("shard-1"))) as journal:
        for record in RECORDS[1]:
            journal.append(record)
    report = check_library(library, REQUEST)
    assert (report.journalled, report.missing, report.is_sound) == (0, 0, True)


def test_damaged_lines_of_a_journal_are_counted(library: ExperienceLibrary) -> None:
    library.shard_path("shard-1").unlink()
    path = journal_path(library.shard_path("shard-1"))
    with Journal(path) as journal:
        for record in RECORDS[1][:4]:
            journal.append(record)
    lines = path.read_bytes().splitlines(keepends=True)
    path.write_bytes(b"".join([lines[0], b"\0" * 500 + b"\n", *lines[2:]]))
    report = check_library(library, REQUEST)
    assert (report.journalled, report.lost_lines, report.missing) == (3, 1, 12)


def test_damaged_files_are_named_and_the_others_counted(library: ExperienceLibrary) -> None:
    shard = library.shard_path("shard-1")
    shard.write_bytes(shard.read_bytes()[:1000])
    (library.path / "empty.parquet").touch()
    report = check_library(library, REQUEST)
    assert [file.name for file in report.damaged] == ["empty.parquet", "shard-1.parquet"]
    assert all(f"{file.name} is damaged" in file.reason for file in report.damaged)
    assert report.incomplete == (1,)
    assert (report.reaches, report.missing, report.is_sound) == (24, 12, False)


def test_reaches_that_are_there_twice_are_named(library: ExperienceLibrary) -> None:
    library.write_shard("twice", RECORDS[1][2:4], REQUEST.scenario)
    report = check_library(library)
    assert set(report.duplicates) == {record.key for record in RECORDS[1][2:4]}
    assert not report.is_sound


def test_mixed_scenarios_are_named(library: ExperienceLibrary) -> None:
    other = load_scenario("cylinder-clutter", "{stop: {timeout_s: 20}}")
    library.write_shard(
        "other",
        [
            replace(make_record(r), scenario=other.digest)
            for r in make_request(scenario=other).reaches(0)
        ],
        other,
    )
    report = check_library(library)
    assert set(report.scenarios) == {REQUEST.scenario.digest, other.digest}
    assert not report.is_sound


def test_a_library_that_is_not_there_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(LibraryError, match="no experience library at"):
        check_library(ExperienceLibrary(tmp_path / "none"))
