"""The runner on a Dask cluster of real processes, some of which die."""

import os
import signal
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

pytest.importorskip("distributed", reason="Dask is missing: pip install 'lic_drake[cluster]'")

from support.collecting import Start, check, wait_until
from support.dask_cluster import DaskCluster, dask_cluster
from support.fake_reach import FakeReach, comparable, expected_records, make_request

from lic_drake.errors import ClusterError
from lic_drake.experience.collect import collect
from lic_drake.experience.runner import Progress, ReachFunction
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.experience.workers import DaskWorkers

REQUEST = make_request()
REACHES = REQUEST.reaches(0)


@pytest.fixture(scope="module")
def dask() -> Iterator[DaskCluster]:
    """A scheduler with two workers, which nannies restart."""
    with dask_cluster(workers=2) as cluster:
        yield cluster


def run(dask: DaskCluster, library: ExperienceLibrary, reach: ReachFunction) -> Progress:
    with DaskWorkers(dask.address) as workers:
        return collect(library, REQUEST, workers, reach=reach)


def test_a_cluster_simulates_the_same_library_in_its_own_processes(
    dask: DaskCluster, library: ExperienceLibrary, reach: FakeReach
) -> None:
    report = run(dask, library, replace(reach, sleep_s=0.02))
    assert (report.done, report.failed) == (36, {})
    assert comparable(library.records()) == expected_records(REQUEST)
    assert len(reach.calls()) == len(set(reach.calls())) == 36
    assert len(reach.processes()) == 2
    assert os.getpid() not in reach.processes()


def test_a_killed_worker_of_a_cluster_costs_only_its_environment(
    dask: DaskCluster, library: ExperienceLibrary, reach: FakeReach
) -> None:
    deadly = replace(reach, deadly=REACHES[7].key, deaths=1)
    assert run(dask, library, deadly).failed == {}
    assert comparable(library.records()) == expected_records(REQUEST)
    assert reach.log.with_suffix(".deaths").read_text() == "x"


def test_an_environment_that_aborts_the_interpreter_is_abandoned(
    dask: DaskCluster, library: ExperienceLibrary, reach: FakeReach
) -> None:
    deadly = replace(reach, deadly=REACHES[7].key, deaths=99, death=signal.SIGABRT)
    report = run(dask, library, deadly)
    assert list(report.failed) == ["training-000000"]
    assert "all those workers died while running it" in report.failed["training-000000"]
    assert {record.environment for record in library.records()} == {1, 2}
    assert run(dask, library, reach).failed == {}
    assert comparable(library.records()) == expected_records(REQUEST)


@pytest.mark.parametrize("end", [signal.SIGINT, signal.SIGKILL])
def test_after_an_interrupted_or_killed_collector_the_same_command_resumes(
    dask: DaskCluster, library: ExperienceLibrary, reach: FakeReach, start: Start, end: int
) -> None:
    options = ("--scheduler", dask.address)
    process = start(library.path, replace(reach, sleep_s=0.1), *options)
    wait_until(lambda: any(library.path.glob("*.parquet")))
    os.killpg(process.pid, end)
    error = process.communicate(timeout=60)[1]
    if end == signal.SIGINT:
        assert process.returncode == 130
        command = f"lic collect {library.path} --scheduler {dask.address}"
        assert error == f"lic: stopped; finished environments are kept, go on with: {command}\n"
    kept = check(library.path)["reaches"]
    assert 12 <= kept < 36
    output, error = start(library.path, reach, *options).communicate(timeout=60)
    assert (error, f"36 of 36 reaches ({36 - kept} new" in output) == ("", True)
    assert comparable(library.records()) == expected_records(REQUEST)


def test_a_worker_with_several_threads_is_rejected(
    dask: DaskCluster, library: ExperienceLibrary, reach: FakeReach
) -> None:
    worker = dask.add_workers(1, threads=2)
    with pytest.raises(ClusterError, match=r"has 2 threads, .* --nworkers 2 --nthreads 1; fin"):
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


def test_workers_that_join_later_are_used_and_a_lost_scheduler_loses_no_shard(
    library: ExperienceLibrary, reach: FakeReach, start: Start
) -> None:
    slow = replace(reach, sleep_s=0.2)
    with dask_cluster(workers=0) as dask:
        process = start(library.path, slow, "--scheduler", dask.address)
        dask.add_workers(2)
        wait_until(lambda: any(library.path.glob("*.parquet")))
        dask.scheduler.kill()
        error = process.communicate(timeout=60)[1]
        assert process.returncode == 2
        waiting, lost = error.splitlines()
        assert "no workers yet, waiting for some; start them with: dask worker tcp" in waiting
        assert "lost the connection to the scheduler" in lost and "; finished env" in lost
    assert 12 <= collect(library, REQUEST, reach=reach).present < 36
    assert comparable(library.records()) == expected_records(REQUEST)
