"""The runner on real processes of this machine and of a Dask cluster, some of which die."""

import os
import signal
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from support.collecting import OPTIONS, Start, is_alive, wait_until
from support.dask_cluster import DaskCluster, dask_cluster
from support.fake_reach import FakeReach, comparable, expected_records, make_request
from support.light_tasks import count_threads, deaths_of, work

from lic_drake.cli.main import main
from lic_drake.errors import ClusterError, PerceptionError
from lic_drake.experience.check import check_library
from lic_drake.experience.collect import collect
from lic_drake.experience.runner import Progress, ReachFunction, Task, run_tasks
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.experience.workers import DaskWorkers, LocalWorkers, Workers

REQUEST = make_request()
NO_DASK = "Dask is missing: pip install 'lic_drake[cluster]'"


@pytest.fixture(scope="module")
def dask() -> Iterator[DaskCluster]:
    """A scheduler with two workers, which nannies restart."""
    pytest.importorskip("distributed", reason=NO_DASK)
    with dask_cluster(workers=2) as cluster:
        yield cluster


@pytest.fixture(params=["local", "dask"])
def options(request: pytest.FixtureRequest) -> tuple[str, str]:
    """Options of `lic collect` for workers: two, or "one" on this machine."""
    if request.param in ("local", "one"):
        return ("--workers", "2" if request.param == "local" else "1")
    return ("--scheduler", request.getfixturevalue("dask").address)


def workers_of(options: tuple[str, str]) -> Workers:
    kind, value = options
    return LocalWorkers(int(value)) if kind == "--workers" else DaskWorkers(value)


def run(options: tuple[str, str], library: ExperienceLibrary, reach: ReachFunction) -> Progress:
    with workers_of(options) as workers:
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


@pytest.mark.parametrize(
    ("options", "end"),
    [("one", signal.SIGINT), ("one", signal.SIGKILL), ("dask", signal.SIGINT)],
    indirect=["options"],
)
def test_after_an_interrupted_or_killed_collector_the_same_request_resumes(
    options: tuple[str, str],
    library: ExperienceLibrary,
    reach: FakeReach,
    start: Start,
    end: signal.Signals,
) -> None:
    hold = library.path.with_name("hold")
    process = start(library.path, replace(reach, sleep_s=0.1, hold=hold), *options)
    wait_until(lambda: any(library.path.glob("*.parquet")))
    hold.touch()  # However slow the machine is, the collection does not end before the signal.
    # Ctrl-C reaches the whole process group.
    (os.killpg if end == signal.SIGINT else os.kill)(process.pid, end)
    error = process.communicate(timeout=60)[1]
    hold.unlink()
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


def is_held(lock: Path) -> bool:
    """Whether a process holds a lock; its file is there before."""
    return lock.exists() and f":{lock.stat().st_ino} " in Path("/proc/locks").read_text()


def test_of_concurrent_collections_shares_fill_one_library_and_any_other_is_rejected(
    tmp_path: Path,
    library: ExperienceLibrary,
    reach: FakeReach,
    start: Start,
    capsys: pytest.CaptureFixture[str],
) -> None:
    hold = tmp_path / "hold"
    hold.touch()
    first = start(library.path, replace(reach, hold=hold), "--workers", "1", "--share", "1/2")
    wait_until(lambda: is_held(library.path / "_collecting-1-of-2.lock"))
    for other in ("1/1", "1/2", "1/3"):
        assert main(["collect", str(library.path), *OPTIONS, "--share", other]) == 2
        assert f"another process is adding to {library.path} (it holds" in capsys.readouterr().err
    # The second share is done before the first has begun a reach.
    assert collect(library, REQUEST, reach=reach, share="2/2").done == 12
    hold.unlink()
    error = first.communicate(timeout=60)[1]
    assert "2 environments x 4 goals x 3 starts, 24 reaches" in error and "lic: " not in error
    assert comparable(library.records()) == expected_records(REQUEST)
    assert len(reach.calls()) == len(set(reach.calls())) == 36
    assert len(reach.processes()) == 2


def test_workers_use_one_blas_thread(monkeypatch: pytest.MonkeyPatch) -> None:
    if (os.cpu_count() or 1) == 1:
        pytest.skip("one CPU: linear algebra has one thread anyway")
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        monkeypatch.delenv(name)
    with LocalWorkers(1) as workers:
        assert workers.submit(count_threads).result() == [1]


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


def run_light(
    options: tuple[str, str], folder: Path, *deadly: object
) -> tuple[dict[str, str], list[str]]:
    """Runs three tasks, the first of which dies; returns those that failed and that finished."""
    finished: list[str] = []
    tasks = [Task("a", (folder, "a", *deadly)), *(Task(name, (folder, name)) for name in "bc")]
    with workers_of(options) as workers:
        failed = run_tasks(tasks, work, workers, lambda task, result: finished.append(result))
    return failed, sorted(finished)


def test_the_calls_in_progress_when_a_worker_was_killed_are_repeated(
    options: tuple[str, str], tmp_path: Path
) -> None:
    assert run_light(options, tmp_path, 1) == ({}, ["a", "b", "c"])
    assert deaths_of(tmp_path, "a") == "x"


def test_a_task_that_aborts_the_interpreter_is_abandoned_and_the_others_finish(
    options: tuple[str, str], tmp_path: Path
) -> None:
    failed, finished = run_light(options, tmp_path, 99, signal.SIGABRT)
    assert list(failed) == ["a"] and " died " in failed["a"]
    assert finished == ["b", "c"]
    if options[0] == "--workers":
        assert deaths_of(tmp_path, "a") == "xxx"


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


def refuse(name: str) -> str:
    if name == "a":
        raise PerceptionError("no ball in view")
    return name


def test_what_only_one_environment_refuses_does_not_end_the_others() -> None:
    finished: list[str] = []
    tasks = [Task(name, (name,)) for name in "abc"]
    failed = run_tasks(tasks, refuse, Workers(), lambda task, result: finished.append(result))
    assert failed == {"a": "no ball in view"} and finished == ["b", "c"]
