"""The journal of a running shard: each finished reach as one line, so that a kill loses none."""

import dataclasses
import json
from pathlib import Path
from typing import Any, BinaryIO, Self

from lic_drake.experience.files import open_locked, readable_errors
from lic_drake.experience.schema import FIELDS, TUPLES
from lic_drake.reach.request import ReachRecord

SUFFIX = ".partial.jsonl"
"""End of a journal's file name."""

_SUCCESS = b'"success": true'


def journal_path(shard: Path) -> Path:
    """Returns the path of a shard's journal; the underscore hides it from Parquet readers."""
    return shard.with_name(f"_{shard.stem}{SUFFIX}")


class Journal:
    """Appends records to a shard's journal and reads those of an earlier, interrupted run.

    Only one process at a time holds a journal; opening waits for the other one to finish.

    Attributes:
        records: The records in the journal, in the order of their appearance.
    """

    def __init__(self, path: Path) -> None:
        """Opens or creates the journal and drops what a kill left of an unfinished line.

        A damaged line among whole ones costs only its own reach.

        Raises:
            LibraryError: The file cannot be opened.
        """
        self._path = path
        with readable_errors(path, "write"):
            self._file = open_locked(path, wait=True)
            content = self._file.read()
            self.records, _ = _parse(content)
            length = content.rfind(b"\n") + 1
            self._file.truncate(length)
            self._file.seek(length)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        self._file.close()

    def append(self, record: ReachRecord) -> None:
        """Adds a finished reach; after the call a kill of this process cannot lose it.

        Raises:
            LibraryError: The line cannot be written (disk full); earlier lines are safe.
        """
        line = json.dumps(dataclasses.asdict(record)).encode() + b"\n"
        with readable_errors(self._path, "write"):
            _write_all(self._file, line)
        self.records.append(record)

    def delete(self) -> None:
        """Removes the file, after the shard has been written."""
        with readable_errors(self._path, "delete"):
            self._path.unlink(missing_ok=True)


class JournalTail:
    """Counts the lines of a journal while another process writes them.

    Attributes:
        finished: Number of finished reaches seen so far.
        successes: How many of them reached the goal.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._offset = 0
        self.finished = 0
        self.successes = 0

    def poll(self) -> None:
        """Looks for new lines."""
        try:
            with self._path.open("rb") as file:
                file.seek(self._offset)
                content = file.read()
        except OSError:  # Not begun, or complete and deleted.
            return
        content = content[: content.rfind(b"\n") + 1]
        self._offset += len(content)
        self.finished += content.count(b"\n")
        self.successes += content.count(_SUCCESS)


def _write_all(file: BinaryIO, line: bytes) -> None:
    """Writes a line; a full disk may take a part of it before it refuses the rest."""
    while line:
        line = line[file.write(line) :]


def read_journal(path: Path) -> tuple[list[ReachRecord], int]:
    """Returns the records of a journal, also one in use, and its number of damaged lines.

    Raises:
        LibraryError: The file cannot be read.
    """
    with readable_errors(path, "read"):
        return _parse(path.read_bytes())


def _parse(content: bytes) -> tuple[list[ReachRecord], int]:
    """Returns the records in the whole lines, and the number of lines that hold none."""
    found = [_parse_line(line) for line in content.split(b"\n")[:-1]]
    records = [record for record in found if record is not None]
    return records, len(found) - len(records)


def _parse_line(line: bytes) -> ReachRecord | None:
    """Returns the record of a line, or None."""
    try:
        data: dict[str, Any] = json.loads(line)
        for name in TUPLES:
            data[name] = tuple(data[name])
        if list(data) != list(FIELDS) or not all(map(_fits, data.values(), FIELDS.values())):
            return None
        return ReachRecord(**data)
    except (ValueError, TypeError, KeyError, RecursionError):
        return None


def _fits(value: object, kind: object) -> bool:
    """Tells whether a value that JSON gave may stand in a column of a Python type."""
    if kind is float:  # JSON has one kind of number; true is none.
        return type(value) is float or (type(value) is int and abs(value) < 2**53)
    if kind is int:
        return type(value) is int and -(2**63) <= value < 2**63
    if kind is str:
        return _is_text(value)
    if kind is bool:
        return type(value) is bool
    return type(value) is tuple and all(_fits(item, float) for item in value)


def _is_text(value: object) -> bool:
    """Tells whether a value is text that files can hold; JSON also has halves of characters."""
    if not isinstance(value, str):
        return False
    try:
        value.encode()
    except UnicodeEncodeError:
        return False
    return True


def journal_paths(library: Path) -> list[Path]:
    """Returns the journals in a library's folder, sorted by name."""
    return sorted(library.glob(f"_*{SUFFIX}"))


def unfinished_reaches(library: Path) -> int:
    """Returns the number of finished reaches in the journals of a library's folder."""
    tails = [JournalTail(path) for path in journal_paths(library)]
    for tail in tails:
        tail.poll()
    return sum(tail.finished for tail in tails)
