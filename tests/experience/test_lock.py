import os
import socket
import threading
from pathlib import Path

import pytest

from lic_drake.errors import LibraryError
from lic_drake.experience.lock import (
    CollectionLock,
    is_going_on,
    lock_path,
    starting,
)
from lic_drake.experience.shard import WHOLE, Shard


def test_workers_go_on_until_the_lock_is_given_back(tmp_path: Path) -> None:
    with CollectionLock(tmp_path) as lock:
        assert is_going_on(lock.path)
        lock.stop_workers()
        assert not is_going_on(lock.path)
    assert list(tmp_path.iterdir()) == []


def test_shares_of_one_division_go_side_by_side_and_stop_by_themselves(tmp_path: Path) -> None:
    with CollectionLock(tmp_path, Shard(1, 3)) as first:
        with CollectionLock(tmp_path, Shard(3, 3)) as third:
            assert is_going_on(first.path)
            assert is_going_on(third.path)
        assert is_going_on(first.path)
        assert not is_going_on(third.path)


@pytest.mark.parametrize(
    ("present", "refused"),
    [
        (WHOLE, WHOLE),
        (WHOLE, Shard(2, 3)),
        (Shard(2, 3), WHOLE),
        (Shard(2, 3), Shard(2, 3)),
        (Shard(2, 3), Shard(1, 4)),
        (Shard(1, 3), Shard(1, 13)),
    ],
    ids=str,
)
def test_an_overlapping_collection_is_refused_and_does_not_disturb_the_first(
    tmp_path: Path, present: Shard, refused: Shard
) -> None:
    holder = f"{lock_path(tmp_path, present).name} is held by process {os.getpid()}"
    with CollectionLock(tmp_path, present) as lock:
        with (
            pytest.raises(LibraryError, match=f"{holder} on {socket.gethostname()}"),
            CollectionLock(tmp_path, refused),
        ):
            pass
        assert is_going_on(lock.path)
    with CollectionLock(tmp_path, refused) as lock:
        assert is_going_on(lock.path)


@pytest.mark.parametrize("left", [WHOLE, Shard(2, 3), Shard(1, 4)], ids=str)
@pytest.mark.parametrize("ours", [WHOLE, Shard(2, 3)], ids=str)
def test_the_lock_of_a_killed_collection_is_taken_over(
    tmp_path: Path, left: Shard, ours: Shard
) -> None:
    lock_path(tmp_path, left).touch()
    with CollectionLock(tmp_path, ours) as lock:
        assert is_going_on(lock.path)
    assert list(tmp_path.iterdir()) == []


def test_one_collection_starts_after_the_other(tmp_path: Path) -> None:
    order: list[str] = []

    def start() -> None:
        with starting(tmp_path):
            order.append("second")

    with starting(tmp_path):
        thread = threading.Thread(target=start)
        thread.start()
        thread.join(0.2)
        order.append("first")
    thread.join(10.0)
    assert order == ["first", "second"]
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_is_not_there_is_named(tmp_path: Path) -> None:
    for begin in (CollectionLock, starting):
        with pytest.raises(LibraryError, match=r"cannot write .*: No such"), begin(tmp_path / "no"):
            pass
