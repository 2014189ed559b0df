"""The runner on real processes of this machine and of a Dask cluster, some of which die."""

import os
import signal
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from support.collecting import OPTIONS, Start, is_alive, wait_until
from support.dask_cluster import DaskCluster, dask_cluster
from support.fake_reach import (
    FakeReach,
    comparable,
    count_threads,
    expected_records,
    make_request,
)

from lic_drake.cli.main import main
from lic_drake.errors import ClusterError
from lic_drake.experience.check import check_library
from lic_drake.experience.collect import collect
from lic_drake.experience.runner import Progress, ReachFunction
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.experience.workers import DaskWorkers, LocalWorkers

REQUEST = make_request()
DEADLY = REQUEST.reaches(0)[7].key
NO_DASK = "Dask is missing: pip install 'lic_drake[cluster]'"


@pytest.fixture(scope="module")
def dask() -> Iterator[DaskCluster]:
    """A scheduler with two workers, which nannies restart."""
    pytest.importorskip("distributed", reason=NO_DASK)
    with dask_cluster(workers=2) as cluster:
        yield cluster


@pytest.fixture(params=["local", "dask"])
def options(request: pytest.FixtureRequest) -> tuple[str, str]:
    """Options of `lic collect` for two workers."""
    if request.param == "local":
        return ("--workers", "2")
    return ("--scheduler", request.getfixturevalue("dask").address)


def run(options: tuple[str, str], library: ExperienceLibrary, reach: ReachFunction) -> Progress:
    kind, value = options
    with LocalWorkers(2) if kind == "--workers" else DaskWorkers(value) as workers:
        return collect(library, REQUEST, workers, reach=reach)


def test_workers_simulate_the_same_library_in_their_own_processes(
    options: tuple[str, str], library: ExperienceLibrary, reach: FakeReach
) -> None:
    report = run(options, library, replace(reach, sleep_s=0.02))
    assert (report.done, report.failed) == (36, {})
    assert comparable(library.records()) == expected_records(REQUEST)
    assert len(reach.calls()) == len(set(reach.calls())) == 36
    assert len(reach.processes()) == 2
    assert os.getpid() not in reach.processes()


def test_a_killed_worker_loses_only_the_environments_in_progress(
    options: tuple[str, str], library: ExperienceLibrary, reach: FakeReach
) -> None:
    assert run(options, library, replace(reach, deadly=DEADLY, deaths=1)).failed == {}
    assert comparable(library.records()) == expected_records(REQUEST)
    assert reach.log.with_suffix(".deaths").read_text() == "x"


def test_an_environment_that_aborts_the_interpreter_is_abandoned_and_the_others_finish(
    options: tuple[str, str], library: ExperienceLibrary, reach: FakeReach
) -> None:
    deadly = replace(reach, deadly=DEADLY, deaths=99, death=signal.SIGABRT)
    report = run(options, library, deadly)
    assert list(report.failed) == ["training-000000"]
    assert " died " in report.failed["training-000000"]
    assert report.done == 24
    assert {record.environment for record in library.records()} == {1, 2}
    if options[0] == "--workers":
        assert reach.log.with_suffix(".deaths").read_text() == "xxx"
    assert collect(library, REQUEST, reach=reach).failed == {}
    assert comparable(library.records()) == expected_records(REQUEST)


@pytest.mark.parametrize("end", [signal.SIGINT, signal.SIGKILL])
def test_after_an_interrupted_or_killed_collector_the_same_request_resumes(
    options: tuple[str, str],
    library: ExperienceLibrary,
    reach: FakeReach,
    start: Start,
    end: signal.Signals,
) -> None:
    process = start(library.path, replace(reach, sleep_s=0.1), *options)
    wait_until(lambda: len(reach.processes()) == 2 and any(library.path.glob("*.parquet")))
    # Ctrl-C reaches the whole process group.
    (os.killpg if end == signal.SIGINT else os.kill)(process.pid, end)
    error = process.communicate(timeout=60)[1]
    if end == signal.SIGINT:
        assert process.returncode == 130
        hint = "finished environments are kept, run the same command to resume"
        assert error.endswith(f"\nlic: interrupted; {hint}\n")
    if options[0] == "--workers":
        wait_until(lambda: not any(map(is_alive, reach.processes())), timeout_s=10.0)
    report = check_library(library)
    assert 12 <= report["reaches"] < 36
    assert report["is_sound"]
    assert collect(library, REQUEST, reach=reach).present == report["reaches"]
    assert comparable(library.records()) == expected_records(REQUEST)


def test_of_two_concurrent_collections_the_second_is_rejected(
    tmp_path: Path,
    library: ExperienceLibrary,
    reach: FakeReach,
    start: Start,
    capsys: pytest.CaptureFixture[str],
) -> None:
    hold = tmp_path / "hold"
    hold.touch()
    first = start(library.path, replace(reach, hold=hold), "--workers", "1")
    wait_until(lambda: any(library.path.glob("*.yaml")))
    assert main(["collect", str(library.path), *OPTIONS, "--share", "1/2"]) == 2
    assert f"another process is adding to {library.path} (it holds" in capsys.readouterr().err
    hold.unlink()
    assert "lic: " not in first.communicate(timeout=60)[1]
    assert check_library(library, REQUEST)["is_sound"]
    assert len(reach.calls()) == len(set(reach.calls())) == 36


def test_shares_of_a_job_array_fill_one_library_concurrently(
    tmp_path: Path, library: ExperienceLibrary, reach: FakeReach, start: Start
) -> None:
    hold = tmp_path / "hold"
    hold.touch()
    first = start(library.path, replace(reach, hold=hold), "--workers", "1", "--share", "1/2")
    wait_until(lambda: any(library.path.glob("*.yaml")))
    # The second is done before the first has begun a reach.
    assert collect(library, REQUEST, reach=reach, share="2/2").done == 12
    hold.unlink()
    error = first.communicate(timeout=60)[1]
    assert "2 environments x 4 goals x 3 starts, 24 reaches" in error and "lic: " not in error
    assert comparable(library.records()) == expected_records(REQUEST)
    assert len(reach.calls()) == 36 and len(reach.processes()) == 2


def test_workers_use_one_blas_thread(
    library: ExperienceLibrary, monkeypatch: pytest.MonkeyPatch
) -> None:
    if (os.cpu_count() or 1) == 1:
        pytest.skip("one CPU: linear algebra has one thread anyway")
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        monkeypatch.delenv(name)
    request = make_request(environments=1, max_goals=1, max_starts=1)
    with LocalWorkers(1) as workers:
        collect(library, request, workers, reach=count_threads)
    assert [record.detail for record in library.records()] == ["[1]"]


def test_a_dask_worker_with_several_threads_is_rejected(
    dask: DaskCluster, library: ExperienceLibrary, reach: FakeReach
) -> None:
    worker = dask.add_workers(1, threads=2, nanny=False)
    with pytest.raises(ClusterError, match=r"has 2 threads, .* --nworkers 2 --nthreads 1; fin"):
        run(("--scheduler", dask.address), library, reach)
    dask.remove(worker)


def test_a_reach_function_that_workers_cannot_import_is_one_error(
    dask: DaskCluster, library: ExperienceLibrary, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "only_here.py").write_text("def reach(request): raise NotImplementedError")
    monkeypatch.syspath_prepend(tmp_path)
    import only_here

    with pytest.raises(ClusterError, match="No module named 'only_here'; install the same pack"):
        run(("--scheduler", dask.address), library, only_here.reach)


def test_dask_workers_that_join_later_are_used_and_a_lost_scheduler_loses_no_shard(
    library: ExperienceLibrary, reach: FakeReach, start: Start
) -> None:
    pytest.importorskip("distributed", reason=NO_DASK)
    with dask_cluster(workers=0) as dask:
        process = start(library.path, replace(reach, sleep_s=0.1), "--scheduler", dask.address)
        assert process.stderr is not None
        waiting = [process.stderr.readline() for _ in range(2)][1]
        assert "no workers yet, waiting for some; start them with: dask worker tcp" in waiting
        dask.add_workers(1, nanny=False)
        wait_until(lambda: any(library.path.glob("*.parquet")))
        dask.scheduler.kill()
        (lost,) = process.communicate(timeout=60)[1].splitlines()
        assert process.returncode == 2
        assert "lost the connection to the scheduler" in lost and "; finished env" in lost
    assert 12 <= collect(library, REQUEST, reach=reach).present < 36
    assert comparable(library.records()) == expected_records(REQUEST)
