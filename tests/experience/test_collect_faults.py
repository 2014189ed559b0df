"""Collection in real processes, some of which die."""

import os
import signal
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pytest
from support.collecting import Start, check, collections, is_alive, wait_until
from support.fake_reach import (
    FakeReach,
    ThreadCountingReach,
    comparable,
    expected_records,
    make_record,
    make_request,
)

from lic_drake.errors import LibraryError
from lic_drake.experience import slots
from lic_drake.experience.collect import collect
from lic_drake.experience.grid import REQUEST_FILE
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.reach.request import ReachRecord, ReachRequest

REQUEST = make_request()
REACHES = REQUEST.reaches(0)


@pytest.fixture
def library(tmp_path: Path) -> ExperienceLibrary:
    return ExperienceLibrary(tmp_path / "library")


@pytest.fixture
def reach(tmp_path: Path) -> FakeReach:
    return FakeReach(log=tmp_path / "calls")


@pytest.fixture
def start() -> Iterator[Start]:
    with collections() as start:
        yield start


def names(library: ExperienceLibrary) -> list[str]:
    return sorted(path.name for path in library.path.iterdir())


def test_the_library_does_not_depend_on_the_number_of_workers(
    tmp_path: Path, reach: FakeReach
) -> None:
    libraries = [ExperienceLibrary(tmp_path / name) for name in ("one", "two")]
    for workers, library in enumerate(libraries, start=1):
        report = collect(library, REQUEST, workers=workers, reach=reach)
        assert report.progress.done == report.progress.total == 36
        assert comparable(library.records()) == expected_records(REQUEST)
    assert len(reach.processes()) == 3
    assert os.getpid() not in reach.processes()


def test_a_killed_worker_costs_only_the_reach_that_it_was_simulating(
    library: ExperienceLibrary, reach: FakeReach
) -> None:
    deadly = replace(reach, deadly=REQUEST.reaches(1)[7].key, deaths=1)
    report = collect(library, REQUEST, workers=2, reach=deadly)
    assert report.failed == ()
    assert comparable(library.records()) == expected_records(REQUEST)
    assert len(reach.calls()) == len(set(reach.calls())) == 36
    assert reach.log.with_suffix(".deaths").read_text() == "x"


@pytest.mark.parametrize("end", [signal.SIGKILL, signal.SIGABRT])
def test_a_deadly_environment_is_left_out_and_the_rest_goes_on(
    library: ExperienceLibrary, reach: FakeReach, end: signal.Signals
) -> None:
    deadly = replace(reach, deadly=REACHES[7].key, deaths=99, death=end)
    report = collect(library, REQUEST, workers=2, reach=deadly)
    (failed,) = report.failed
    assert failed.environment == 0
    assert failed.reason == (
        "its worker process died 2 times at the same reach,"
        f" from start {REACHES[7].start} to goal {REACHES[7].goal}"
    )
    assert report.progress.done == 24 + 7
    assert {record.environment for record in library.records()} == {1, 2}
    assert reach.log.with_suffix(".deaths").read_text() == "xx"
    # What was finished before the deaths is still there for a later run.
    later = collect(library, REQUEST, reach=reach)
    assert (later.progress.present, later.failed) == (31, ())
    assert comparable(library.records()) == expected_records(REQUEST)
    assert len(reach.calls()) == len(set(reach.calls())) == 36


@dataclass(frozen=True)
class PreemptedReach(FakeReach):
    """Lets its worker die at every fifth reach, but at each only once."""

    def __call__(self, request: ReachRequest) -> ReachRecord:
        fatal = [item.key for item in REACHES[4::5]]
        died = self.log.with_suffix(f".{request.key}")
        if request.key in fatal and not died.exists():
            died.touch()
            signal.raise_signal(signal.SIGKILL)
        return super().__call__(request)


def test_workers_that_die_at_different_reaches_do_not_make_an_environment_deadly(
    library: ExperienceLibrary, reach: FakeReach
) -> None:
    report = collect(library, make_request(environments=1), reach=PreemptedReach(log=reach.log))
    assert (report.failed, report.progress.done) == ((), 12)
    assert len(reach.processes()) == 3


def test_a_worker_is_replaced_after_a_number_of_tasks(
    library: ExperienceLibrary, reach: FakeReach, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(slots, "TASKS_PER_EXECUTOR", 2)
    request = make_request(environments=5)
    assert collect(library, request, workers=1, reach=reach).progress.done == 60
    assert len(reach.processes()) == 3


def test_a_disk_that_refuses_the_worker_is_one_line_and_loses_nothing(
    library: ExperienceLibrary, reach: FakeReach
) -> None:
    line = 1 + max(len(str(make_record(item))) for item in REQUEST.reaches(0))
    limited = replace(reach, max_file_bytes=5 * line)
    with pytest.raises(LibraryError, match=r"partial\.jsonl: File too large; .* are kept") as error:
        collect(library, REQUEST, workers=2, reach=limited)
    assert "\n" not in str(error.value)
    tried = len(reach.calls())
    later = collect(library, REQUEST, reach=reach)
    assert 4 <= later.progress.present < tried <= later.progress.present + 2
    assert comparable(library.records()) == expected_records(REQUEST)


def test_ctrl_c_stops_quietly_and_the_same_command_goes_on(
    library: ExperienceLibrary, reach: FakeReach, start: Start
) -> None:
    slow = replace(reach, sleep_s=0.1)
    process = start(library.path, slow, "--workers", "2")
    wait_until(lambda: len(reach.calls()) >= 5)
    os.killpg(process.pid, signal.SIGINT)
    output, error = process.communicate(timeout=60)
    assert process.returncode == 130
    assert error == (
        f"lic: stopped; finished reaches are kept, go on with: lic collect {library.path}\n"
    )
    assert "Traceback" not in output + error
    kept = len(reach.calls())
    assert kept < 36
    assert not any(is_alive(worker) for worker in reach.processes())

    output, error = start(library.path, slow, "--workers", "2").communicate(timeout=60)
    assert error == ""
    assert f"36 of 36 reaches ({36 - kept} new" in output
    assert comparable(library.records()) == expected_records(REQUEST)
    assert len(reach.calls()) == len(set(reach.calls())) == 36


def test_a_second_ctrl_c_does_not_wait_for_the_running_reaches(
    library: ExperienceLibrary, reach: FakeReach, start: Start
) -> None:
    process = start(library.path, replace(reach, sleep_s=600.0), "--workers", "2")
    wait_until(lambda: len(list(library.path.glob("_*.partial.jsonl"))) == 2)
    os.killpg(process.pid, signal.SIGINT)
    wait_until(lambda: not (library.path / "_collecting").exists())
    os.killpg(process.pid, signal.SIGINT)
    process.communicate(timeout=60)
    # A shell shows 130 for both: a second Ctrl-C may also come while the interpreter shuts down.
    assert process.returncode in (130, -signal.SIGINT)


def test_a_killed_collection_leaves_no_workers_and_loses_no_finished_reach(
    library: ExperienceLibrary, reach: FakeReach, start: Start
) -> None:
    process = start(library.path, replace(reach, sleep_s=0.1), "--workers", "2")
    wait_until(lambda: len(reach.processes()) == 2 and len(reach.calls()) >= 5)
    workers = reach.processes()
    process.kill()
    process.communicate(timeout=60)
    wait_until(lambda: not any(is_alive(worker) for worker in workers), timeout_s=10.0)
    finished = set(reach.calls())

    report = collect(library, REQUEST, workers=2, reach=reach)
    # A worker may die between a reach and its line in the journal.
    assert len(finished) - 2 <= report.progress.present <= len(finished)
    assert comparable(library.records()) == expected_records(REQUEST)
    assert len(reach.calls()) == 36 + len(finished) - report.progress.present


@pytest.mark.parametrize(
    ("name", "faults"),
    [
        ("_training-000000.partial.jsonl", {"max_file_bytes": 4_000, "fatal_limit": True}),
        (
            ".training-000000.parquet.tmp",
            {"max_file_bytes": 15_000, "fatal_limit": True, "limit_at": REACHES[11].key},
        ),
    ],
    ids=["journal", "shard"],
)
def test_a_kill_of_everything_in_the_middle_of_a_write_loses_no_finished_reach(
    library: ExperienceLibrary, reach: FakeReach, start: Start, name: str, faults: dict[str, Any]
) -> None:
    process = start(library.path, replace(reach, **faults), "--workers", "1")
    process.communicate(timeout=60)
    assert process.returncode == -signal.SIGKILL
    # It died at this very byte.
    assert (library.path / name).stat().st_size == faults["max_file_bytes"]
    finished = len(reach.calls())

    report = check(library.path)
    torn = 1 if "jsonl" in name else 0
    assert (report["journalled"], report["reaches"]) == (finished - torn, 0)
    assert (report["damaged"], report["duplicates"]) == ([], [])
    assert (report["requested"], report["incomplete"]) == (36, [0, 1, 2])

    error = start(library.path, reach, "--workers", "2").communicate(timeout=60)[1]
    assert error == ""
    assert comparable(library.records()) == expected_records(REQUEST)
    assert len(reach.calls()) == 36 + torn
    assert names(library) == [REQUEST_FILE, *(f"training-{e:06d}.parquet" for e in range(3))]


def test_a_kill_in_the_middle_of_writing_the_request_leaves_none(
    library: ExperienceLibrary, reach: FakeReach, start: Start
) -> None:
    process = start(library.path, reach, fatal_bytes=1_000)
    process.communicate(timeout=60)
    assert process.returncode == -signal.SIGKILL
    assert (library.path / f".{REQUEST_FILE}.tmp").stat().st_size == 1_000
    assert not (library.path / REQUEST_FILE).exists()
    error = start(library.path, reach).communicate(timeout=60)[1]
    assert error == ""
    assert check(library.path)["is_sound"]
    assert names(library) == [REQUEST_FILE, *(f"training-{e:06d}.parquet" for e in range(3))]


@pytest.fixture
def disk(tmp_path: Path) -> Iterator[Path]:
    """A disk of 44 kB: the second shard does not fit."""
    path = tmp_path / "disk"
    path.mkdir()
    command = ["mount", "-t", "tmpfs", "-o", "size=44k", "tmpfs", str(path)]
    if subprocess.run(command, capture_output=True).returncode != 0:
        pytest.skip("mounting a small disk needs root")
    yield path
    subprocess.run(["umount", "--lazy", str(path)], check=True)


def test_a_full_disk_is_one_line_and_with_more_space_the_same_command_goes_on(
    disk: Path, reach: FakeReach, start: Start
) -> None:
    library = ExperienceLibrary(disk / "library")
    process = start(library.path, reach, "--workers", "2")
    error = process.communicate(timeout=60)[1]
    assert process.returncode == 2
    assert error.count("\n") == 1
    assert "No space left on device; check free space and permissions; finished reaches" in error
    finished = len(reach.calls())
    report = check(library.path)
    kept = report["reaches"] + report["journalled"]
    assert finished - 2 <= kept <= finished < 36
    assert (report["damaged"], report["duplicates"]) == ([], [])

    subprocess.run(["mount", "-o", "remount,size=4m", str(disk)], check=True)
    output, error = start(library.path, reach).communicate(timeout=60)
    assert (error, f"({36 - kept} new" in output) == ("", True)
    assert comparable(library.records()) == expected_records(REQUEST)
    assert len(reach.calls()) == 36 + finished - kept


def test_of_two_collections_at_once_the_second_is_refused_and_the_first_completes(
    tmp_path: Path, library: ExperienceLibrary, reach: FakeReach, start: Start
) -> None:
    hold = tmp_path / "hold"
    hold.touch()
    first = start(library.path, replace(reach, hold=hold), "--workers", "2")
    wait_until(lambda: len(list(library.path.glob("_*.partial.jsonl"))) == 2)
    for options in ((), ("--shard", "1/2")):
        second = start(library.path, reach, *options)
        error = second.communicate(timeout=60)[1]
        assert second.returncode == 2
        assert f"at work on {library.path} (_collecting is held by process {first.pid} on" in error
    hold.unlink()
    assert first.communicate(timeout=60)[1] == ""
    assert check(library.path)["is_sound"]
    assert len(reach.calls()) == len(set(reach.calls())) == 36


def test_the_shards_of_a_job_array_fill_one_library_side_by_side(
    library: ExperienceLibrary, reach: FakeReach, start: Start
) -> None:
    library.create()
    (library.path / "_collecting").write_text("a killed collection left this behind")
    slow = replace(reach, sleep_s=0.05)
    shards = [start(library.path, slow, "--workers", "1", "--shard", f"{k}/3") for k in (1, 2, 3)]
    results = [process.communicate(timeout=60) for process in shards]
    assert [error for _, error in results] == ["", "", ""]
    assert all("1 environments x 4 goals x 3 starts = 12 reaches" in out for out, _ in results)
    assert comparable(library.records()) == expected_records(REQUEST)
    assert len(reach.calls()) == len(reach.processes()) * 12 == 36
    assert names(library) == [REQUEST_FILE, *(f"training-{e:06d}.parquet" for e in range(3))]
    assert check(library.path)["is_sound"]


def test_workers_do_their_linear_algebra_on_one_thread(library: ExperienceLibrary) -> None:
    if (os.cpu_count() or 1) == 1:
        pytest.skip("one CPU: linear algebra has one thread anyway")
    request = make_request(environments=1, max_goals=1, max_starts=1)
    collect(library, request, reach=ThreadCountingReach())
    assert [record.detail for record in library.records()] == ["[1]"]
