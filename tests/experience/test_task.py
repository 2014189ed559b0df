"""What a worker does with a task, and where it refuses to work."""

from dataclasses import replace
from pathlib import Path
from socket import gethostname

import pytest
from support.fake_reach import FakeReach, comparable, make_record, make_request

from lic_drake.errors import LibraryError
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.experience.task import Task, run_task

REQUEST = make_request()
RECORDS = [make_record(item) for item in REQUEST.reaches(2)]


@pytest.fixture
def task(tmp_path: Path) -> Task:
    """The reaches into environment 2, of a collection that goes on."""
    library = tmp_path / "library"
    library.mkdir()
    lock = library / "_collecting"
    lock.touch()
    return Task(
        library=library,
        lock=lock,
        request=REQUEST,
        scenario_digest=REQUEST.scenario.digest,
        environment=2,
        missing=None,
        reach=FakeReach(log=tmp_path / "calls"),
    )


def test_a_task_makes_the_shard_of_its_environment(task: Task) -> None:
    report = run_task(task)
    assert (report.finished, report.successes) == (12, sum(r.success for r in RECORDS))
    assert comparable(ExperienceLibrary(task.shard).records()) == comparable(RECORDS)
    assert task.shard.name == "training-000002.parquet"


def test_a_task_that_is_run_twice_simulates_once(task: Task) -> None:
    run_task(task)
    before = task.shard.read_bytes()
    assert run_task(task).finished == 12
    assert task.shard.read_bytes() == before
    assert len(task.reach.calls()) == 12


def test_only_the_missing_reaches_are_simulated(task: Task) -> None:
    missing = frozenset(record.key for record in RECORDS[3:5])
    assert run_task(replace(task, missing=missing)).finished == 2
    assert comparable(ExperienceLibrary(task.shard).records()) == comparable(RECORDS[3:5])


def test_a_worker_that_does_not_see_the_library_says_so(task: Task) -> None:
    away = replace(task, library=task.library / "away")
    with pytest.raises(LibraryError, match=rf"{gethostname()} does not see .*away; workers need"):
        run_task(away)


def test_a_worker_that_sees_another_folder_of_the_same_name_says_so(task: Task) -> None:
    task.lock.unlink()
    with pytest.raises(LibraryError, match=f"{gethostname()} sees another folder at"):
        run_task(task)
    assert list(task.library.iterdir()) == []


@pytest.mark.parametrize("values", [{"scenario_digest": "0" * 12}, {"missing": frozenset({"0"})}])
def test_a_worker_that_computes_other_reaches_refuses(
    task: Task, values: dict[str, object]
) -> None:
    with pytest.raises(LibraryError, match="install the same lic_drake everywhere"):
        run_task(replace(task, **values))
    assert task.reach.calls() == []
