import dataclasses
import errno
import os
import struct
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from support.fake_reach import make_record, make_request

from lic_drake.errors import LibraryError
from lic_drake.experience.schema import (
    read_shard,
    to_records,
    to_table,
    write_atomically,
    write_table,
)
from lic_drake.reach.request import ReachRecord
from lic_drake.reach.scenario import load_scenario, parse_scenario

REQUEST = make_request()
RECORDS = [make_record(item) for item in REQUEST.reaches(0)]

# Every bit pattern: zeros of both signs, infinities, and NaNs that carry a payload.
any_float = st.integers(0, 2**64 - 1).map(
    lambda bits: struct.unpack("<d", struct.pack("<Q", bits))[0]
)
awkward_float = st.sampled_from([0.0, -0.0, float("inf"), float("nan"), 5e-324, 0.1])
VALUES = {
    str: st.text(st.characters(codec="utf-8"), max_size=8),
    int: st.integers(-(2**63), 2**63 - 1),
    float: any_float | awkward_float,
    bool: st.booleans(),
    tuple[float, ...]: st.lists(any_float | awkward_float, max_size=8).map(tuple),
}
FIELDS = {item.name: item.type for item in dataclasses.fields(ReachRecord)}
any_record = st.builds(ReachRecord, **{name: VALUES[kind] for name, kind in FIELDS.items()})


def _bits(value: object) -> object:
    """Floats as bytes; other values with their types."""
    if isinstance(value, float):
        return struct.pack("<d", value)
    if isinstance(value, tuple | list):
        return [type(value), *map(_bits, value)]
    return _bits(tuple(vars(value).values())) if isinstance(value, ReachRecord) else value


@pytest.fixture
def shard(tmp_path: Path) -> Path:
    path = tmp_path / "shard.parquet"
    write_table(to_table(RECORDS, REQUEST.scenario), path)
    return path


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=20)
@given(st.lists(any_record, max_size=5))
def test_records_round_trip_bit_for_bit(tmp_path: Path, records: list[ReachRecord]) -> None:
    path = tmp_path / "any.parquet"
    write_table(to_table(records, REQUEST.scenario), path)
    assert _bits(to_records(read_shard(path)[1])) == _bits(records)


def test_a_file_carries_units_and_the_whole_scenario(tmp_path: Path) -> None:
    scenario = load_scenario("cylinder-clutter", "{task: {goal_area: {step_m: 0.3}}}")
    path = tmp_path / "shard.parquet"
    write_table(to_table([], scenario), path)
    header, _ = read_shard(path)
    assert parse_scenario(header["scenario"]) == scenario
    assert header["scenario_digest"] == scenario.digest
    schema = pq.read_schema(path)
    assert schema.names == list(FIELDS)
    assert schema.field("peak_force").metadata[b"unit"] == b"N"
    assert all(schema.field(name).metadata[b"doc"] for name in schema.names)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=100)
@given(st.data())
def test_a_flipped_byte_raises_nothing_but_library_errors(shard: Path, data: st.DataObject) -> None:
    content = bytearray(shard.read_bytes())
    position = data.draw(st.integers(0, len(content) - 1))
    content[position] = data.draw(st.integers(0, 255))
    damaged = shard.with_name("damaged.parquet")
    damaged.write_bytes(content)
    with suppress(LibraryError):
        assert len(to_records(read_shard(damaged)[1])) == len(RECORDS)


def test_a_flipped_byte_in_any_column_is_detected(shard: Path) -> None:
    content = shard.read_bytes()
    chunks = pq.read_metadata(shard).row_group(0)
    for i in range(chunks.num_columns):
        chunk = chunks.column(i)
        begin = chunk.dictionary_page_offset or chunk.data_page_offset
        damaged = bytearray(content)
        damaged[begin + chunk.total_compressed_size - 1] ^= 0xFF
        shard.write_bytes(damaged)
        with pytest.raises(LibraryError, match="is damaged"):
            read_shard(shard)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda t: t.replace_schema_metadata({b"\xff": b"\xfe"}), "is not part of an experience"),
        (
            lambda t: t.replace_schema_metadata(
                {**t.schema.metadata, b"lic_drake.schema_version": b"99"}
            ),
            "has schema version 99, written by lic_drake 0.1.0, or .* reads version 4:",
        ),
        (lambda t: t.drop_columns(["peak_force"]), "or other columns"),
    ],
)
def test_incompatible_tables_are_rejected(
    shard: Path, change: Callable[[pa.Table], pa.Table], message: str
) -> None:
    pq.write_table(change(pq.read_table(shard)), shard)
    with pytest.raises(LibraryError, match=message) as caught:
        read_shard(shard)
    assert str(shard) in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("failure", ["fsync", "replace", "interrupt"])
def test_failed_and_killed_writes_leave_the_old_file_and_do_no_harm(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, failure: str
) -> None:
    path = tmp_path / "file"
    path.write_text("old")
    (tmp_path / ".file.tmp").write_text("a longer half of a file, left by a killed process")

    def fail(*_: object) -> None:
        if failure == "interrupt":
            raise KeyboardInterrupt
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with monkeypatch.context() as patch:
        patch.setattr(os, "fsync" if failure == "interrupt" else failure, fail)
        with pytest.raises((LibraryError, KeyboardInterrupt)) as caught:
            write_atomically(path, lambda temporary: temporary.write_text("new"))
    if failure != "interrupt":
        assert str(caught.value).startswith(f"cannot write {path}: No space left on device; check")
    assert [(p.name, p.read_text()) for p in tmp_path.iterdir()] == [("file", "old")]
    write_atomically(path, lambda temporary: temporary.write_text("new"))
    assert [(p.name, p.read_text()) for p in tmp_path.iterdir()] == [("file", "new")]
