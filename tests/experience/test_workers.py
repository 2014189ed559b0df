"""The runner on real processes, some of which die."""

import os
import signal
from dataclasses import replace
from pathlib import Path

import pytest
from support.collecting import Start, check, is_alive, wait_until
from support.fake_reach import (
    FakeReach,
    comparable,
    count_threads,
    expected_records,
    make_request,
)

from lic_drake.experience.collect import collect
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.experience.workers import LocalWorkers

REQUEST = make_request()
REACHES = REQUEST.reaches(0)


def test_the_library_does_not_depend_on_the_number_of_workers(
    tmp_path: Path, reach: FakeReach
) -> None:
    libraries = [ExperienceLibrary(tmp_path / name) for name in ("one", "two")]
    for count, library in enumerate(libraries, start=1):
        with LocalWorkers(count) as workers:
            assert collect(library, REQUEST, workers, reach=reach).done == 36
        assert comparable(library.records()) == expected_records(REQUEST)
    assert len(reach.processes()) == 3
    assert os.getpid() not in reach.processes()


def test_a_killed_worker_loses_only_the_environments_in_progress(
    library: ExperienceLibrary, reach: FakeReach
) -> None:
    deadly = replace(reach, deadly=REQUEST.reaches(1)[7].key, deaths=1)
    with LocalWorkers(2) as workers:
        assert collect(library, REQUEST, workers, reach=deadly).failed == {}
    assert comparable(library.records()) == expected_records(REQUEST)
    assert reach.log.with_suffix(".deaths").read_text() == "x"


def test_a_deadly_environment_is_abandoned_and_the_others_finish(
    library: ExperienceLibrary, reach: FakeReach
) -> None:
    deadly = replace(reach, deadly=REACHES[7].key, deaths=99)
    with LocalWorkers(2) as workers:
        report = collect(library, REQUEST, workers, reach=deadly)
    assert report.failed == {"training-000000": "its worker process died 3 times"}
    assert report.done == 24
    assert {record.environment for record in library.records()} == {1, 2}
    assert reach.log.with_suffix(".deaths").read_text() == "xxx"
    assert collect(library, REQUEST, reach=reach).failed == {}
    assert comparable(library.records()) == expected_records(REQUEST)


def test_ctrl_c_stops_quietly_and_the_same_command_resumes(
    library: ExperienceLibrary, reach: FakeReach, start: Start
) -> None:
    slow = replace(reach, sleep_s=0.1)
    process = start(library.path, slow, "--workers", "2")
    wait_until(lambda: any(library.path.glob("*.parquet")))
    os.killpg(process.pid, signal.SIGINT)
    output, error = process.communicate(timeout=60)
    assert process.returncode == 130
    assert error == (
        f"lic: stopped; finished environments are kept, go on with: lic collect {library.path}\n"
    )
    assert "Traceback" not in output + error
    assert not any(is_alive(worker) for worker in reach.processes())
    report = check(library.path)
    kept = report["reaches"]
    assert 12 <= kept < 36
    assert (report["damaged"], report["duplicates"]) == ({}, [])

    output, error = start(library.path, reach, "--workers", "2").communicate(timeout=60)
    assert error == ""
    assert f"36 of 36 reaches ({36 - kept} new" in output
    assert comparable(library.records()) == expected_records(REQUEST)


def test_a_killed_collection_leaves_no_workers_and_loses_no_finished_environment(
    library: ExperienceLibrary, reach: FakeReach, start: Start
) -> None:
    process = start(library.path, replace(reach, sleep_s=0.1), "--workers", "2")
    wait_until(lambda: len(reach.processes()) == 2 and any(library.path.glob("*.parquet")))
    process.kill()
    process.communicate(timeout=60)
    wait_until(lambda: not any(map(is_alive, reach.processes())), timeout_s=10.0)
    finished = len(library.records())
    with LocalWorkers(2) as workers:
        assert collect(library, REQUEST, workers, reach=reach).present == finished >= 12
    assert comparable(library.records()) == expected_records(REQUEST)


def test_of_two_concurrent_collections_the_second_is_rejected(
    tmp_path: Path, library: ExperienceLibrary, reach: FakeReach, start: Start
) -> None:
    hold = tmp_path / "hold"
    hold.touch()
    first = start(library.path, replace(reach, hold=hold), "--workers", "2")
    wait_until(lambda: any(library.path.glob("*.yaml")))
    for options in ((), ("--share", "1/2")):
        second = start(library.path, reach, *options)
        error = second.communicate(timeout=60)[1]
        assert second.returncode == 2
        assert f"another process is adding to {library.path} (it holds" in error
    hold.unlink()
    assert first.communicate(timeout=60)[1] == ""
    assert check(library.path)["is_sound"]
    assert len(reach.calls()) == len(set(reach.calls())) == 36


def test_shares_of_a_job_array_fill_one_library_concurrently(
    library: ExperienceLibrary, reach: FakeReach, start: Start
) -> None:
    slow = replace(reach, sleep_s=0.05)
    shares = [start(library.path, slow, "--workers", "1", "--share", f"{k}/3") for k in (1, 2, 3)]
    results = [process.communicate(timeout=60) for process in shares]
    assert [error for _, error in results] == ["", "", ""]
    assert all("1 environments x 4 goals x 3 starts = 12 reaches" in out for out, _ in results)
    assert comparable(library.records()) == expected_records(REQUEST)
    assert len(reach.calls()) == len(reach.processes()) * 12 == 36
    assert check(library.path)["is_sound"]


def test_workers_use_one_blas_thread(library: ExperienceLibrary) -> None:
    if (os.cpu_count() or 1) == 1:
        pytest.skip("one CPU: linear algebra has one thread anyway")
    request = make_request(environments=1, max_goals=1, max_starts=1)
    with LocalWorkers(1) as workers:
        collect(library, request, workers, reach=count_threads)
    assert [record.detail for record in library.records()] == ["[1]"]
