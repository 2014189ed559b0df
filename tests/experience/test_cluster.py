"""Collection on a Dask cluster of real processes, some of which die."""

import os
import signal
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

pytest.importorskip("distributed", reason="Dask is missing: pip install 'lic_drake[cluster]'")

from support.collecting import Start, check, collections, wait_until
from support.dask_cluster import DaskCluster, dask_cluster
from support.fake_reach import (
    FakeReach,
    ThreadCountingReach,
    comparable,
    expected_records,
    make_request,
)

from lic_drake.errors import ClusterError
from lic_drake.experience.cluster import Cluster
from lic_drake.experience.collect import CollectionReport, collect
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.experience.task import ReachFunction

REQUEST = make_request()
REACHES = REQUEST.reaches(0)


@pytest.fixture(scope="module")
def dask() -> Iterator[DaskCluster]:
    """A scheduler with two workers, which nannies start again when they die."""
    with dask_cluster(workers=2) as cluster:
        yield cluster


@pytest.fixture
def start() -> Iterator[Start]:
    with collections() as start:
        yield start


@pytest.fixture
def library(tmp_path: Path) -> ExperienceLibrary:
    return ExperienceLibrary(tmp_path / "library")


@pytest.fixture
def reach(tmp_path: Path) -> FakeReach:
    return FakeReach(log=tmp_path / "calls")


def run(dask: DaskCluster, library: ExperienceLibrary, reach: ReachFunction) -> CollectionReport:
    with Cluster(dask.address) as cluster:
        return collect(
            library,
            REQUEST,
            workers=cluster.num_workers,
            make_executor=cluster.make_executor,
            reach=reach,
        )


def test_a_cluster_makes_the_same_library_in_its_own_processes(
    dask: DaskCluster,
    library: ExperienceLibrary,
    reach: FakeReach,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)  # The workers have another working directory.
    report = run(dask, ExperienceLibrary("library"), replace(reach, sleep_s=0.02))
    assert (report.progress.done, report.failed) == (36, ())
    assert comparable(library.records()) == expected_records(REQUEST)
    assert len(reach.calls()) == len(set(reach.calls())) == 36
    assert len(reach.processes()) == 2
    assert os.getpid() not in reach.processes()
    assert check(library.path)["is_sound"]


def test_a_cluster_does_its_linear_algebra_on_one_thread(
    dask: DaskCluster, library: ExperienceLibrary
) -> None:
    if (os.cpu_count() or 1) == 1:
        pytest.skip("one CPU: linear algebra has one thread anyway")
    run(dask, library, ThreadCountingReach())
    assert {record.detail for record in library.records()} == {"[1]"}


def test_a_killed_worker_of_a_cluster_costs_only_the_reach_that_it_was_simulating(
    dask: DaskCluster, library: ExperienceLibrary, reach: FakeReach
) -> None:
    deadly = replace(reach, deadly=REACHES[7].key, deaths=1)
    assert run(dask, library, deadly).failed == ()
    assert comparable(library.records()) == expected_records(REQUEST)
    assert len(reach.calls()) == len(set(reach.calls())) == 36
    assert reach.log.with_suffix(".deaths").read_text() == "x"


def test_an_environment_that_aborts_the_interpreter_is_left_out_after_two_tries(
    dask: DaskCluster, library: ExperienceLibrary, reach: FakeReach
) -> None:
    deadly = replace(reach, deadly=REACHES[7].key, deaths=99, death=signal.SIGABRT)
    report = run(dask, library, deadly)
    (failed,) = report.failed
    assert failed.environment == 0
    assert failed.reason.startswith("its worker process died 2 times at the same reach, from")
    assert reach.log.with_suffix(".deaths").read_text() == "xx"
    assert {record.environment for record in library.records()} == {1, 2}
    assert check(library.path)["incomplete"] == [0]
    assert run(dask, library, reach).failed == ()
    assert comparable(library.records()) == expected_records(REQUEST)
    assert len(reach.calls()) == len(set(reach.calls())) == 36


def test_ctrl_c_stops_the_workers_tasks_and_the_same_command_goes_on(
    dask: DaskCluster, library: ExperienceLibrary, reach: FakeReach, start: Start
) -> None:
    slow = replace(reach, sleep_s=0.1)
    options = ("--scheduler", dask.address)
    process = start(library.path, slow, *options)
    wait_until(lambda: len(reach.calls()) >= 5)
    os.killpg(process.pid, signal.SIGINT)
    error = process.communicate(timeout=60)[1]
    assert process.returncode == 130
    command = f"lic collect {library.path} --scheduler {dask.address}"
    assert error == f"lic: stopped; finished reaches are kept, go on with: {command}\n"
    kept = len(reach.calls())
    assert kept < 36
    report = check(library.path)
    assert report["reaches"] + report["journalled"] == kept

    output, error = start(library.path, slow, *options).communicate(timeout=60)
    assert (error, f"36 of 36 reaches ({36 - kept} new" in output) == ("", True)
    assert comparable(library.records()) == expected_records(REQUEST)
    assert len(reach.calls()) == len(set(reach.calls())) == 36


def test_what_the_workers_of_a_killed_collector_go_on_doing_is_not_done_twice(
    dask: DaskCluster, library: ExperienceLibrary, reach: FakeReach, start: Start
) -> None:
    slow = replace(reach, sleep_s=0.1)
    process = start(library.path, slow, "--scheduler", dask.address)
    wait_until(lambda: len(reach.processes()) == 2 and len(reach.calls()) >= 5)
    process.kill()
    process.communicate(timeout=60)
    report = run(dask, library, slow)
    assert (report.progress.done, report.failed) == (36, ())
    assert comparable(library.records()) == expected_records(REQUEST)
    assert len(reach.calls()) == len(set(reach.calls())) == 36


def test_the_address_of_a_worker_is_not_taken_for_the_schedulers(dask: DaskCluster) -> None:
    from distributed import Client

    with Client(dask.address, set_as_default=False) as client:
        worker = next(iter(client.nthreads()))
    with pytest.raises(ClusterError, match=rf"answers at '{worker}' \(found a Worker\)"):
        Cluster(worker)


def test_a_worker_with_several_threads_is_refused(
    dask: DaskCluster, library: ExperienceLibrary, reach: FakeReach
) -> None:
    worker = dask.add_workers(1, threads=2)
    with pytest.raises(ClusterError, match=r"has 2 threads, .* --nworkers 2 --nthreads 1; fin"):
        run(dask, library, reach)
    dask.remove(worker)


def test_a_worker_with_another_lic_drake_is_refused(
    dask: DaskCluster, library: ExperienceLibrary, reach: FakeReach
) -> None:
    worker = dask.add_workers(1, module="support.strange_dask_worker")
    with pytest.raises(ClusterError, match=r"lacks lic_drake .* \(it has: 0.0.1\); install"):
        run(dask, library, reach)
    dask.remove(worker)


def test_a_reach_function_that_workers_cannot_import_is_one_error(
    dask: DaskCluster, library: ExperienceLibrary, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "only_here.py").write_text("def reach(request): raise NotImplementedError")
    monkeypatch.syspath_prepend(tmp_path)
    import only_here

    with pytest.raises(ClusterError, match="No module named 'only_here'; install the same pack"):
        run(dask, library, only_here.reach)


def test_workers_that_join_later_are_used_and_a_lost_scheduler_loses_no_reach(
    library: ExperienceLibrary, reach: FakeReach, start: Start
) -> None:
    slow = replace(reach, sleep_s=0.4)
    with dask_cluster(workers=0) as dask:
        process = start(library.path, slow, "--scheduler", dask.address)
        dask.add_workers(1)
        wait_until(lambda: len(reach.processes()) == 1)
        dask.add_workers(1)
        wait_until(lambda: len(reach.processes()) == 2)
        dask.scheduler.kill()
        error = process.communicate(timeout=60)[1]
        assert process.returncode == 2
        waiting, lost = error.splitlines()
        assert "no workers yet, waiting for some; start them with: dask worker tcp" in waiting
        assert f"lost the connection to the scheduler at {dask.address}; finished" in lost
    finished = len(reach.calls())
    report = collect(library, REQUEST, workers=2, reach=reach)
    assert finished - 2 <= report.progress.present <= finished
    assert comparable(library.records()) == expected_records(REQUEST)
    assert len(reach.calls()) == 36 + finished - report.progress.present
