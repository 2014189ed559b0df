import resource
import threading
from pathlib import Path

import pytest
from support.fake_reach import comparable, make_record, make_request

from lic_drake.errors import LibraryError
from lic_drake.experience.journal import Journal, JournalTail, read_journal

RECORDS = [make_record(item) for item in make_request().reaches(0)]


@pytest.fixture
def path(tmp_path: Path) -> Path:
    path = tmp_path / "_shard.partial.jsonl"
    with Journal(path) as journal:
        for record in RECORDS[:6]:
            journal.append(record)
    return path


def test_records_come_back_with_nan_and_tuples(path: Path) -> None:
    assert any(record.outcome == "invalid_start" for record in RECORDS[:6])
    with Journal(path) as journal:
        assert comparable(journal.records) == comparable(RECORDS[:6])


def test_a_torn_last_line_is_dropped_and_the_journal_goes_on(path: Path) -> None:
    content = path.read_bytes()
    ends = [i + 1 for i, byte in enumerate(content) if byte == ord("\n")]
    for length in range(0, len(content) + 1, 41):
        path.write_bytes(content[:length])
        whole = sum(end <= length for end in ends)
        with Journal(path) as journal:
            assert comparable(journal.records) == comparable(RECORDS[:whole])
            journal.append(RECORDS[7])
        with Journal(path) as journal:
            assert comparable(journal.records) == comparable([*RECORDS[:whole], RECORDS[7]])


@pytest.mark.parametrize("junk", [b"\0" * 300, b"\0\n", b"{}\n", b"[1]\n", b'{"key": 1}\n', b"\n"])
def test_what_is_no_record_is_dropped(path: Path, junk: bytes) -> None:
    path.write_bytes(path.read_bytes() + junk)
    with Journal(path) as journal:
        assert comparable(journal.records) == comparable(RECORDS[:6])


def test_damage_in_the_middle_costs_only_its_own_lines(path: Path) -> None:
    lines = path.read_bytes().splitlines(keepends=True)
    path.write_bytes(b"".join([*lines[:2], b"\0" * 4096 + b"\n", *lines[3:]]))
    with Journal(path) as journal:
        assert comparable(journal.records) == comparable(RECORDS[:2] + RECORDS[3:6])
        journal.append(RECORDS[7])
    records, damaged = read_journal(path)
    assert comparable(records) == comparable([*RECORDS[:2], *RECORDS[3:6], RECORDS[7]])
    assert damaged == 1


def test_a_journal_in_use_is_read_up_to_its_last_whole_line(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-10])
    records, damaged = read_journal(path)
    assert (comparable(records), damaged) == (comparable(RECORDS[:5]), 0)


def test_a_file_that_cannot_grow_keeps_its_whole_lines(path: Path) -> None:
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    # The kernel takes a part of the next line and refuses the rest.
    resource.setrlimit(resource.RLIMIT_FSIZE, (path.stat().st_size + 100, limits[1]))
    try:
        with Journal(path) as journal, pytest.raises(LibraryError, match="File too large; check"):
            journal.append(RECORDS[6])
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert not path.read_bytes().endswith(b"\n")
    with Journal(path) as journal:
        assert comparable(journal.records) == comparable(RECORDS[:6])


def test_a_second_writer_waits_for_the_first(path: Path) -> None:
    seen: list[int] = []

    def read() -> None:
        with Journal(path) as journal:
            seen.append(len(journal.records))

    with Journal(path) as journal:
        thread = threading.Thread(target=read)
        thread.start()
        thread.join(0.2)
        assert seen == []
        journal.append(RECORDS[6])
    thread.join(10.0)
    assert seen == [7]


def test_the_next_writer_does_not_use_a_journal_that_the_first_one_deleted(path: Path) -> None:
    def write() -> None:
        with Journal(path) as journal:
            journal.append(RECORDS[8])

    with Journal(path) as journal:
        thread = threading.Thread(target=write)
        thread.start()
        thread.join(0.2)
        journal.delete()
    thread.join(10.0)
    with Journal(path) as journal:
        assert comparable(journal.records) == comparable([RECORDS[8]])


def test_a_tail_counts_whole_lines_and_successes_as_they_come(path: Path) -> None:
    content = path.read_bytes()
    tail = JournalTail(path)
    for length in range(0, len(content) + 1, 333):
        path.write_bytes(content[:length])
        tail.poll()
        assert tail.finished == content[:length].count(b"\n")
        assert tail.successes == sum(record.success for record in RECORDS[: tail.finished])
    path.unlink()
    tail.poll()
    assert tail.finished >= 5
