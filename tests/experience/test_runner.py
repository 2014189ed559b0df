"""The runner in this process: what is simulated, what is not, and what stops it."""

import errno
import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from support.fake_reach import FakeReach, comparable, expected_records, make_record, make_request

from lic_drake.errors import ClusterError, LibraryError
from lic_drake.experience.collect import REQUEST_FILE, collect, read_request
from lic_drake.experience.runner import simulate
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.reach.request import ReachRecord, ReachRequest
from lic_drake.reach.scenario import load_scenario

REQUEST = make_request()
SHARDS = [f"training-{e:06d}.parquet" for e in range(3)]


def names(library: ExperienceLibrary) -> list[str]:
    return sorted(path.name for path in library.path.iterdir() if path.suffix != ".lock")


def test_a_collection_fills_the_library_and_a_second_run_simulates_nothing(
    library: ExperienceLibrary, reach: FakeReach
) -> None:
    seen: list[tuple[int, str]] = []
    report = collect(
        library, REQUEST, reach=reach, progress=lambda p: seen.append((p.done, p.describe()))
    )
    assert comparable(library.records()) == expected_records(REQUEST)
    assert names(library) == [REQUEST_FILE, *SHARDS]
    assert read_request(library.path / REQUEST_FILE) == REQUEST
    assert (report.failed, report.present, report.done) == ({}, 0, 36)
    assert report.successes == sum(record.success for record in library.records())
    assert [done for done, _ in seen] == [12, 24, 36]
    assert seen[-1][1].endswith("0:00 h left")

    again = collect(library, REQUEST, reach=reach)
    assert len(reach.calls()) == 36
    assert (again.present, again.done, again.successes) == (36, 36, report.successes)


def test_more_requests_into_an_environment_are_added_to_its_shard(
    library: ExperienceLibrary, reach: FakeReach
) -> None:
    requests = REQUEST.reaches(1)
    simulate(requests[:5], library, reach=reach)
    simulate([*requests[3:], requests[0]], library, reach=reach)
    assert comparable(library.records()) == comparable([make_record(r) for r in requests])
    assert names(library) == SHARDS[1:2]
    assert len(reach.calls()) == len(requests)


def test_a_library_of_another_scenario_is_rejected_before_any_simulation(
    library: ExperienceLibrary, reach: FakeReach
) -> None:
    simulate(REQUEST.all_reaches(), library, reach=reach)
    other = load_scenario("cylinder-clutter", "{stop: {timeout_s: 20}}")
    with pytest.raises(LibraryError, match="holds reaches of scenario"):
        collect(library, replace(REQUEST, scenario=other), reach=reach)
    assert names(library) == SHARDS
    assert len(reach.calls()) == 36


def test_a_collection_completes_what_a_share_began(
    library: ExperienceLibrary, reach: FakeReach
) -> None:
    report = collect(library, REQUEST, share="2/3", reach=reach)
    assert (report.total, report.done) == (12, 12)
    assert names(library) == [REQUEST_FILE, SHARDS[1]]
    assert collect(library, REQUEST, share="7/7", reach=reach).total == 0
    assert collect(library, REQUEST, reach=reach).present == 12
    assert comparable(library.records()) == expected_records(REQUEST)
    assert len(reach.calls()) == 36


def test_reaches_in_other_files_are_not_simulated_again(
    library: ExperienceLibrary, reach: FakeReach
) -> None:
    collect(library, REQUEST, reach=reach)
    library.compact()
    collect(library, replace(REQUEST, environments=4), reach=reach)
    assert len(reach.calls()) == 4 * 12
    assert names(library) == [REQUEST_FILE, "reaches.parquet", "training-000003.parquet"]


@pytest.mark.parametrize("change", [{"key": "0" * 16}, {"lic_drake_version": "0.0.1"}])
def test_records_of_a_worker_with_another_lic_drake_are_rejected(
    library: ExperienceLibrary, change: dict[str, str]
) -> None:
    def strange(request: ReachRequest) -> ReachRecord:
        return replace(make_record(request), **change)

    with pytest.raises(
        ClusterError, match="simulated different reaches from those of training-000000"
    ):
        collect(library, REQUEST, reach=strange)
    assert library.successes() == {}


def test_a_full_disk_is_one_line_and_loses_no_finished_environment(
    library: ExperienceLibrary, reach: FakeReach, monkeypatch: pytest.MonkeyPatch
) -> None:
    from lic_drake.experience import store

    def refuse_the_second(table: Any, path: Path) -> None:
        if "000001" in path.name:
            path.write_bytes(b"half a shard")
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        write_table(table, path)

    write_table = store.write_table
    monkeypatch.setattr(store, "write_table", refuse_the_second)
    with pytest.raises(LibraryError, match=r"000001\.parquet: No space left .* are kept") as error:
        collect(library, REQUEST, reach=reach)
    assert "\n" not in str(error.value)
    assert names(library) == [REQUEST_FILE, SHARDS[0]]
    monkeypatch.undo()
    assert collect(library, REQUEST, reach=reach).present == 12
    assert comparable(library.records()) == expected_records(REQUEST)
    assert len(reach.calls()) == 36 + 12


def test_a_truncated_shard_is_named_and_simulated_again_once_deleted(
    library: ExperienceLibrary, reach: FakeReach
) -> None:
    collect(library, REQUEST, reach=reach)
    shard = library.shard_path("training-000001")
    shard.write_bytes(shard.read_bytes()[:-50])
    with pytest.raises(LibraryError, match=r"training-000001\.parquet is damaged .*, delete it"):
        collect(library, REQUEST, reach=reach)
    shard.unlink()
    collect(library, REQUEST, reach=reach)
    assert comparable(library.records()) == expected_records(REQUEST)
    assert len(reach.calls()) == 36 + 12
