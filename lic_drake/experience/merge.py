"""Merges libraries into one Parquet file, for instance to ship it."""

import dataclasses
import os
from collections.abc import Sequence
from pathlib import Path

from lic_drake.errors import LibraryError
from lic_drake.experience.files import readable_errors, write_atomically
from lic_drake.experience.schema import to_records, to_table, write_table
from lic_drake.experience.store import SUFFIX, ExperienceLibrary
from lic_drake.reach.request import ReachRecord


def merge_libraries(sources: Sequence[ExperienceLibrary], output: Path) -> int:
    """Writes all reaches of some libraries of one scenario into one file.

    A reach that several libraries hold with the same result is written once. The rows are sorted
    by environment and keep their order within it.

    Args:
        sources: One or more libraries.
        output: A file that does not exist yet, with the suffix .parquet.

    Returns:
        The number of rows written.

    Raises:
        LibraryError: The scenarios differ, two libraries hold different results of the same
            reach, or a file cannot be read or written.
    """
    if output.suffix != SUFFIX:
        raise LibraryError(f"the merged file needs the suffix {SUFFIX}, got {output}")
    if os.path.exists(output):
        raise LibraryError(f"{output} exists; delete it or choose another name")
    header = sources[0].header()
    merged: dict[str, ReachRecord] = {}
    for source in sources:
        digest = source.header().scenario_digest
        if digest != header.scenario_digest:
            raise LibraryError(
                f"{source.path} holds scenario {digest}, but {sources[0].path} holds"
                f" {header.scenario_digest}; merge libraries of one scenario only"
            )
        for record in to_records(source.table()):
            earlier = merged.setdefault(record.key, record)
            if earlier is not record and _content(earlier) != _content(record):
                raise LibraryError(
                    f"{source.path} holds another result of reach {record.key} than an earlier"
                    " library; find out which one is right before merging"
                )
    rows = sorted(merged.values(), key=lambda record: (record.stream, record.environment))
    table = to_table(rows, header)
    with readable_errors(output.parent, "create the folder"):
        output.parent.mkdir(parents=True, exist_ok=True)
    write_atomically(output, lambda temporary: write_table(table, temporary))
    return len(rows)


def _content(record: ReachRecord) -> str:
    """Returns everything but the wall time as text, in which NaN equals NaN."""
    values = dataclasses.asdict(record)
    del values["wall_time_s"]
    return repr(values)
