"""Collection on threads: what is simulated, what is not, and what stops it."""

import errno
import os
from concurrent.futures import Executor, ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from support.fake_reach import FakeReach, comparable, expected_records, make_record, make_request

from lic_drake.errors import LibraryError
from lic_drake.experience import collect as dut
from lic_drake.experience import journal
from lic_drake.experience.collect import CollectionReport, collect
from lic_drake.experience.grid import REQUEST_FILE, read_request
from lic_drake.experience.journal import Journal, journal_path
from lic_drake.experience.merge import merge_libraries
from lic_drake.experience.progress import Progress
from lic_drake.experience.shard import Shard
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.reach.request import ReachRecord, ReachRequest
from lic_drake.reach.scenario import load_scenario

REQUEST = make_request()


@pytest.fixture
def library(tmp_path: Path) -> ExperienceLibrary:
    return ExperienceLibrary(tmp_path / "library")


@pytest.fixture
def reach(tmp_path: Path) -> FakeReach:
    return FakeReach(log=tmp_path / "calls")


def make_thread() -> Executor:
    return ThreadPoolExecutor(max_workers=1)


def run(library: ExperienceLibrary, reach: Any, **values: Any) -> CollectionReport:
    values = {"request": REQUEST, "workers": 2, "make_executor": make_thread, **values}
    return collect(library, reach=reach, **values)


def names(library: ExperienceLibrary) -> list[str]:
    return sorted(path.name for path in library.path.iterdir())


def test_a_collection_fills_the_library_and_leaves_only_shards_and_the_request(
    library: ExperienceLibrary, reach: FakeReach
) -> None:
    report = run(library, reach)
    assert comparable(library.records()) == expected_records(REQUEST)
    assert names(library) == [REQUEST_FILE, *(f"training-{e:06d}.parquet" for e in range(3))]
    assert read_request(library.path / REQUEST_FILE) == REQUEST
    assert (report.failed, report.progress.present, report.progress.done) == ((), 0, 36)
    assert report.progress.successes == sum(record.success for record in library.records())


def test_a_second_run_simulates_nothing(library: ExperienceLibrary, reach: FakeReach) -> None:
    first = run(library, reach).progress
    second = run(library, reach).progress
    assert len(reach.calls()) == 36
    assert (second.present, second.done, second.successes) == (36, 36, first.successes)


def test_more_environments_add_to_the_library(library: ExperienceLibrary, reach: FakeReach) -> None:
    larger = replace(REQUEST, environments=5)
    run(library, reach)
    run(library, reach, request=larger)
    assert comparable(library.records()) == expected_records(larger)
    assert len(reach.calls()) == 5 * 12
    assert read_request(library.path / REQUEST_FILE) == larger


def test_another_request_is_refused_before_anything_is_simulated(
    library: ExperienceLibrary, reach: FakeReach
) -> None:
    run(library, reach)
    before = names(library)
    with pytest.raises(LibraryError, match="was begun with max_goals 4 instead of 5"):
        run(library, reach, request=replace(REQUEST, max_goals=5))
    (library.path / REQUEST_FILE).unlink()
    other = load_scenario("cylinder-clutter", "{stop: {timeout_s: 20}}")
    with pytest.raises(LibraryError, match="holds reaches of scenario"):
        run(library, reach, request=replace(REQUEST, scenario=other))
    assert names(library) == before[1:]
    assert len(reach.calls()) == 36


def test_shards_share_the_environments_and_any_collection_completes_them(
    library: ExperienceLibrary, reach: FakeReach
) -> None:
    larger = replace(REQUEST, environments=5)
    report = run(library, reach, request=larger, shard=Shard(2, 3))
    assert (report.progress.total, report.progress.done) == (24, 24)
    assert names(library) == [REQUEST_FILE, "training-000001.parquet", "training-000004.parquet"]
    assert read_request(library.path / REQUEST_FILE) == larger
    assert run(library, reach, request=larger, shard=Shard(7, 7)).progress.total == 0
    rest = run(library, reach, request=larger)
    assert (rest.progress.total, rest.progress.present) == (60, 24)
    assert comparable(library.records()) == expected_records(larger)
    assert len(reach.calls()) == 60


def test_the_number_of_tasks_at_work_follows_the_number_of_workers(
    library: ExperienceLibrary, reach: FakeReach, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(dut, "POLL_S", 0.02)
    counts = iter([0, 0, 1, 1])
    seen: list[int] = []
    run(
        library,
        replace(reach, sleep_s=0.02),
        workers=lambda: next(counts, 3),
        progress=lambda progress: seen.append(progress.at_work),
    )
    assert seen[:4] == [0, 0, 1, 1]
    assert max(seen) == 3
    assert comparable(library.records()) == expected_records(REQUEST)


def test_reaches_that_came_from_elsewhere_are_not_simulated_again(
    tmp_path: Path, library: ExperienceLibrary, reach: FakeReach
) -> None:
    run(library, reach)
    other = ExperienceLibrary(tmp_path / "other")
    other.create()
    merge_libraries([library], other.path / "all.parquet")
    run(other, reach, request=replace(REQUEST, environments=4))
    assert len(reach.calls()) == 4 * 12
    assert names(other) == [REQUEST_FILE, "all.parquet", "training-000003.parquet"]


def test_an_interrupted_environment_goes_on_from_its_journal_and_its_shard(
    library: ExperienceLibrary, reach: FakeReach
) -> None:
    records = [make_record(item) for item in REQUEST.reaches(1)]
    shard = library.write_shard("training-000001", records[:3], REQUEST.scenario)
    with Journal(journal_path(shard)) as partial:
        for record in records[7:2:-1]:
            partial.append(record)
    seen: list[Progress] = []
    report = run(library, reach, progress=seen.append)
    assert (report.progress.present, seen[0].present) == (8, 8)
    assert comparable(library.records()) == expected_records(REQUEST)
    assert not set(reach.calls()) & {record.key for record in records[:8]}
    assert len(reach.calls()) == 36 - 8


def test_the_journal_of_a_complete_shard_is_removed(
    library: ExperienceLibrary, reach: FakeReach
) -> None:
    run(library, reach)
    with Journal(journal_path(library.shard_path("training-000001"))) as partial:
        partial.append(make_record(REQUEST.reaches(1)[0]))
    assert run(library, reach).progress.done == 36
    assert names(library) == [REQUEST_FILE, *(f"training-{e:06d}.parquet" for e in range(3))]


def test_progress_grows_reach_by_reach_to_the_total(
    library: ExperienceLibrary, reach: FakeReach, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(dut, "POLL_S", 0.02)
    seen: list[Progress] = []
    run(library, replace(reach, sleep_s=0.02), workers=1, progress=seen.append)
    done = [progress.done for progress in seen]
    assert done == sorted(done)
    assert done[-1] == 36
    assert len(set(done)) > 12
    assert seen[-1].successes == sum(record.success for record in library.records())
    assert seen[-1].time_left_s == 0.0
    assert seen[-1].reaches_per_minute == pytest.approx(60 * 36 / seen[-1].elapsed_s)


def test_an_environment_that_raises_is_reported_and_the_rest_goes_on(
    library: ExperienceLibrary, reach: FakeReach
) -> None:
    report = run(library, replace(reach, failing_environment=1))
    assert [(f.environment, f.reason) for f in report.failed] == [
        (1, "ArithmeticError: no such environment")
    ]
    assert report.progress.done == 24
    assert {record.environment for record in library.records()} == {0, 2}


def test_a_record_of_another_request_is_not_taken(library: ExperienceLibrary) -> None:
    def mixed_up(request: ReachRequest) -> ReachRecord:
        return replace(make_record(request), key="0" * 16)

    report = run(library, mixed_up)
    assert len(report.failed) == 3
    assert "has the key 0000000000000000" in report.failed[0].reason
    assert library.keys() == set()


def test_a_full_disk_stops_with_one_line_and_loses_no_finished_reach(
    library: ExperienceLibrary, reach: FakeReach, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_all = journal._write_all
    written: list[bytes] = []

    def fill_up(file: Any, line: bytes) -> None:
        if len(reach.calls()) > 17:
            file.write(line[:100])
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        write_all(file, line)
        written.append(line)

    monkeypatch.setattr(journal, "_write_all", fill_up)
    with pytest.raises(
        LibraryError, match=r"No space left on device; .* finished reaches are kept"
    ):
        run(library, reach)
    simulated = len(reach.calls())
    monkeypatch.undo()
    report = run(library, reach)
    assert comparable(library.records()) == expected_records(REQUEST)
    assert report.progress.present == len(written)
    assert len(reach.calls()) == simulated + 36 - len(written)


def test_a_shard_that_does_not_fit_leaves_its_journal(
    library: ExperienceLibrary, reach: FakeReach, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr("lic_drake.experience.store.write_table", refuse)
    with pytest.raises(LibraryError, match=r"training-000000\.parquet: No space left on device"):
        run(library, reach, workers=1)
    monkeypatch.undo()
    assert names(library) == [REQUEST_FILE, "_training-000000.partial.jsonl"]
    run(library, reach)
    assert comparable(library.records()) == expected_records(REQUEST)
    assert len(reach.calls()) == 36


def test_an_interrupt_stops_after_the_running_reaches_and_keeps_them(
    library: ExperienceLibrary, reach: FakeReach, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(dut, "POLL_S", 0.02)

    def interrupt(progress: Progress) -> None:
        if progress.done >= 5 and len(interrupted) == 0:
            interrupted.append(progress.done)
            raise KeyboardInterrupt

    interrupted: list[int] = []
    slow = replace(reach, sleep_s=0.02)
    with pytest.raises(KeyboardInterrupt):
        run(library, slow, progress=interrupt)
    simulated = len(reach.calls())
    assert interrupted[0] <= simulated <= interrupted[0] + 6
    assert "_collecting" not in names(library)
    report = run(library, slow)
    assert report.progress.present == simulated
    assert comparable(library.records()) == expected_records(REQUEST)
    assert len(reach.calls()) == len(set(reach.calls())) == 36


def test_a_damaged_shard_is_named_and_its_reaches_come_back_after_its_deletion(
    library: ExperienceLibrary, reach: FakeReach
) -> None:
    run(library, reach)
    shard = library.shard_path("training-000001")
    shard.write_bytes(shard.read_bytes()[:-50])
    with pytest.raises(LibraryError, match=r"training-000001\.parquet is damaged .*, delete it"):
        run(library, reach)
    shard.unlink()
    run(library, reach)
    assert comparable(library.records()) == expected_records(REQUEST)
    assert len(reach.calls()) == 36 + 12
