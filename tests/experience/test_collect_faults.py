"""Collection in real processes, some of which die."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from fake_reach import FakeReach, comparable, expected_records, make_record, make_request

from lic_drake.errors import LibraryError
from lic_drake.experience import slots
from lic_drake.experience.collect import collect
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.reach.request import ReachRecord, ReachRequest

REQUEST = make_request()

Start = Callable[..., "subprocess.Popen[str]"]

COLLECT = """
import sys
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from fake_reach import FakeReach
from lic_drake.cli.main import main
import lic_drake.experience.collect as module
reach = FakeReach(log=Path(sys.argv[2]), sleep_s=float(sys.argv[3]))
module.collect = partial(module.collect, reach=reach)
options = "--workers 2 --environments 3 --max-goals 4 --max-starts 3"
sys.exit(main(["collect", sys.argv[1], *options.split()]))
"""


@pytest.fixture
def library(tmp_path: Path) -> ExperienceLibrary:
    return ExperienceLibrary(tmp_path / "library")


@pytest.fixture
def reach(tmp_path: Path) -> FakeReach:
    return FakeReach(log=tmp_path / "calls")


@pytest.fixture
def start(library: ExperienceLibrary, reach: FakeReach) -> Iterator[Start]:
    """Starts `lic collect` with the fake reach in a process group of its own."""
    # A killed process leaves its temporary files, and pytest's folders are too deep for a socket.
    with TemporaryDirectory() as folder:
        yield lambda sleep_s=0.1: subprocess.Popen(
            [sys.executable, "-c", COLLECT, str(library.path), str(reach.log), str(sleep_s)],
            env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[1]), "TMPDIR": folder},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )


def wait_until(condition: Callable[[], bool], timeout_s: float = 60.0) -> None:
    deadline = time.monotonic() + timeout_s
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.02)


def is_alive(process: int) -> bool:
    """Whether a process runs; one that has ended and waits for its parent does not."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


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


def test_a_deadly_environment_is_left_out_and_the_rest_goes_on(
    library: ExperienceLibrary, reach: FakeReach
) -> None:
    deadly = replace(reach, deadly=REQUEST.reaches(0)[7].key, deaths=99)
    report = collect(library, REQUEST, workers=2, reach=deadly)
    assert [(f.environment, f.reason) for f in report.failed] == [
        (0, "its worker process died 2 times")
    ]
    assert report.progress.done == 24 + 7
    assert {record.environment for record in library.records()} == {1, 2}
    assert reach.log.with_suffix(".deaths").read_text() == "xx"
    # What was finished before the deaths is still there for a later run.
    later = collect(library, REQUEST, reach=reach)
    assert (later.progress.present, later.failed) == (31, ())
    assert comparable(library.records()) == expected_records(REQUEST)
    assert len(reach.calls()) == len(set(reach.calls())) == 36


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
    process = start()
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

    output, error = start().communicate(timeout=60)
    assert error == ""
    assert f"36 of 36 reaches ({36 - kept} new" in output
    assert comparable(library.records()) == expected_records(REQUEST)
    assert len(reach.calls()) == len(set(reach.calls())) == 36


def test_a_second_ctrl_c_does_not_wait_for_the_running_reaches(
    library: ExperienceLibrary, start: Start
) -> None:
    process = start(sleep_s=600.0)
    wait_until(lambda: len(list(library.path.glob("_*.partial.jsonl"))) == 2)
    os.killpg(process.pid, signal.SIGINT)
    wait_until(lambda: not (library.path / "_collecting").exists())
    os.killpg(process.pid, signal.SIGINT)
    try:
        process.communicate(timeout=60)
    finally:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
    # A shell shows 130 for both: a second Ctrl-C may also come while the interpreter shuts down.
    assert process.returncode in (130, -signal.SIGINT)


def test_a_killed_collection_leaves_no_workers_and_loses_no_finished_reach(
    library: ExperienceLibrary, reach: FakeReach, start: Start
) -> None:
    process = start()
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


@dataclass(frozen=True)
class ThreadCountingReach:
    """Notes in each record how many threads the linear algebra of the worker may use."""

    def __call__(self, request: ReachRequest) -> ReachRecord:
        import numpy as np
        import scipy.linalg
        from threadpoolctl import threadpool_info

        scipy.linalg.solve(np.eye(2), np.ones(2))
        threads = sorted({pool["num_threads"] for pool in threadpool_info()})
        return replace(make_record(request), detail=str(threads))


def test_workers_do_their_linear_algebra_on_one_thread(library: ExperienceLibrary) -> None:
    if (os.cpu_count() or 1) == 1:
        pytest.skip("one CPU: linear algebra has one thread anyway")
    request = make_request(environments=1, max_goals=1, max_starts=1)
    collect(library, request, reach=ThreadCountingReach())
    assert [record.detail for record in library.records()] == ["[1]"]
