from pathlib import Path

import pytest

from lic_drake.errors import LibraryError
from lic_drake.experience.lock import LOCK_FILE, CollectionLock, is_going_on


def test_workers_go_on_until_the_lock_is_given_back(tmp_path: Path) -> None:
    with CollectionLock(tmp_path) as lock:
        assert is_going_on(tmp_path)
        lock.stop_workers()
        assert not is_going_on(tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_a_second_collection_is_refused_and_does_not_disturb_the_first(tmp_path: Path) -> None:
    with CollectionLock(tmp_path):
        with (
            pytest.raises(LibraryError, match="another lic collect is at work on"),
            CollectionLock(tmp_path),
        ):
            pass
        assert is_going_on(tmp_path)


def test_the_lock_of_a_killed_collection_is_taken_over(tmp_path: Path) -> None:
    (tmp_path / LOCK_FILE).touch()
    with CollectionLock(tmp_path):
        assert is_going_on(tmp_path)


def test_a_folder_that_is_not_there_is_named(tmp_path: Path) -> None:
    with (
        pytest.raises(LibraryError, match=r"cannot write .*: No such file"),
        CollectionLock(tmp_path / "none"),
    ):
        pass
