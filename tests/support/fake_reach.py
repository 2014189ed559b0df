"""Reaches without a simulator: records made from the request alone, and faults on demand."""

import hashlib
import math
import os
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from lic_drake.experience import collect as collect_module
from lic_drake.experience.collect import (
    REQUEST_FILE,
    CollectionRequest,
    collect,
    write_request,
)
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.reach.request import ReachRecord, ReachRequest, flat_starts
from lic_drake.reach.scenario import load_scenario
from lic_drake.reach.start import IN_PLANE
from support.light_tasks import append


def make_request(**values: object) -> CollectionRequest:
    """A small collection: 3 environments x 4 goals x 3 starts unless told otherwise."""
    scenario = load_scenario("cylinder-clutter")
    defaults = {"scenario": scenario, "environments": 3, "max_goals": 4, "max_starts": 3}
    return CollectionRequest(**{**defaults, **values})


def fill_library(path: Path) -> Path:
    """Makes a complete library of the records below: 3 environments x 4 goals x 3 starts."""
    library, request = ExperienceLibrary(path), make_request()
    for environment in request.environment_indices:
        records = [make_record(item) for item in request.reaches(environment)]
        library.write_shard(f"training-{environment:06d}", records, request.scenario)
    write_request(request, path / REQUEST_FILE)
    return path


def collect_here(
    monkeypatch: pytest.MonkeyPatch, reach: Callable[[ReachRequest], ReachRecord]
) -> None:
    """Lets `lic collect` use a fake reach in this process."""

    def fake(library: Any, request: Any, workers: Any, **options: Any) -> Any:
        return collect(library, request, reach=reach, **options)

    monkeypatch.setattr(collect_module, "collect", fake)


def make_record(request: ReachRequest) -> ReachRecord:
    """A record whose numbers are drawn from the key; reaches from y = -0.3 m never began."""
    digest = hashlib.sha256(request.key.encode()).digest()
    x0, b0 = request.start.x0.tolist(), request.start.b0.tolist()
    began = len(x0) != IN_PLANE or x0[1] > -0.25
    success = began and digest[0] % 2 == 1
    numbers = [int.from_bytes(digest[i : i + 4]) / 2**32 if began else math.nan for i in range(12)]
    return ReachRecord(
        key=request.key,
        category=request.scenario.category,
        robot=request.scenario.robot,
        scenario=request.scenario.digest,
        stream=request.stream,
        environment=request.environment,
        goal_x=float(request.goal[0]),
        goal_y=float(request.goal[1]),
        goal_z=float(request.goal[2]),
        start_x=x0[0],
        start_y=x0[1],
        start_phi=x0[2] if len(x0) == IN_PLANE else 0.0,
        outcome="reached" if success else "stuck" if began else "invalid_start",
        success=success,
        final_x=numbers[0],
        final_y=numbers[1],
        final_phi=numbers[2],
        final_vx=numbers[3],
        final_vy=numbers[4],
        min_distance=numbers[5],
        peak_force=numbers[6],
        mean_force=numbers[7],
        peak_contacts=digest[1] if began else 0,
        mean_contacts=numbers[8],
        duration_s=30.0 * numbers[9] if began else 0.0,
        wall_time_s=time.perf_counter(),
        q_start=tuple(numbers[:3]) if began else (),
        q_final=tuple(numbers[3:6]) if began else (),
        detail="" if began else 'the arm touches "success": true\r\n at its start',
        lic_drake_version="0.1.0",
        drake_version="1.58.0",
        base_x=b0[0],
        base_y=b0[1],
        after=flat_starts(request.after),
        torso=b0[2],
        **_pose_in_space(tuple(x0), numbers),
    )


def _pose_in_space(start: tuple[float, ...], numbers: list[float]) -> dict[str, float]:
    """Columns that poses in the plane do not have."""
    if len(start) == IN_PLANE:
        return {}
    axes = ("z", "qw", "qx", "qy", "qz")
    first = {f"start_{axis}": value for axis, value in zip(axes, start[2:], strict=True)}
    last = {f"final_{axis}": value for axis, value in zip(axes, numbers[5:10], strict=True)}
    return {**first, **last, "final_vz": numbers[11]}


@dataclass(frozen=True, kw_only=True)
class FakeReach:
    """A reach function that notes each call and can fail in the ways of the real world.

    Attributes:
        log: File that gets a line "key pid" for each finished call.
        sleep_s: Duration of a call, seconds.
        hold: A call waits as long as this file is there.
        failing_environment: Environment whose reaches raise.
    """

    log: Path
    sleep_s: float = 0.0
    hold: Path = Path("/nowhere")
    failing_environment: int = -1

    def __call__(self, request: ReachRequest) -> ReachRecord:
        if request.environment == self.failing_environment:
            raise ArithmeticError("no such\nenvironment")
        time.sleep(self.sleep_s)
        while self.hold.exists():
            time.sleep(0.02)
        append(self.log, f"{request.key} {os.getpid()}\n")
        return make_record(request)

    def calls(self) -> list[str]:
        """Keys of the finished calls."""
        return [line.split()[0] for line in self._lines()]

    def processes(self) -> set[int]:
        """Ids of the processes that finished calls."""
        return {int(line.split()[1]) for line in self._lines()}

    def _lines(self) -> list[str]:
        return self.log.read_text().splitlines() if self.log.exists() else []


def comparable(records: list[ReachRecord]) -> list[str]:
    """Records as text without what differs between runs; NaN equals NaN."""
    return [
        repr({name: value for name, value in vars(record).items() if name != "wall_time_s"})
        for record in records
    ]


def expected_records(request: CollectionRequest) -> list[str]:
    """What a complete library of a request holds, as `comparable` text."""
    return comparable(
        [
            make_record(item)
            for environment in request.environment_indices
            for item in request.reaches(environment)
        ]
    )
