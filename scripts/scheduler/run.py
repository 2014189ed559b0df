"""Measures what a collection costs beside its reaches: disk, messages, the Dask scheduler's time.

Starts a scheduler and workers on this machine. The figures of a million reaches follow from the
measured ones and from --reach-s, which is by default the mean wall time in the shipped library.

    python scripts/scheduler/run.py > notebooks/results/scaling/README.md
"""

import argparse
import math
import os
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from lic_drake.experience.collect import CollectionRequest, collect
from lic_drake.experience.dask_workers import DaskWorkers
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.paths import shipped_library
from lic_drake.reach.request import ReachRecord, ReachRequest

MILLION = 1_000_000
PER_TASK = 945
"""Reaches of one environment in the paper's grid: 45 goals x 21 starts."""

IDLE_S = 5
MAX_HEARTBEATS = 200
"""The workers of a Dask cluster together send no more heartbeats in a second."""

ONE = "`lic collect`, one reach a task"
ALL = "`lic collect`, 945 reaches a task"


@cache
def example() -> ReachRecord:
    return ExperienceLibrary(shipped_library("cylinder-clutter")).records()[400]


def instant_reach(request: ReachRequest) -> ReachRecord:
    """Takes no time; the workers import it."""
    return replace(example(), key=request.key, environment=request.environment)


def instant(index: int) -> int:
    return index


@dataclass(frozen=True)
class Cost:
    """What a number of tasks, or of seconds of idling, took.

    Attributes:
        tasks: The number.
        wall_s: Wall time.
        scheduler_s: CPU time of the scheduler.
        collector_s: CPU time of this process.
        traffic: Messages and bytes through the scheduler's connections.
    """

    tasks: int
    wall_s: float
    scheduler_s: float
    collector_s: float
    traffic: dict[str, float]


def count_traffic(dask_scheduler: Any) -> None:
    """Runs in the scheduler: counts what goes through its connections from now on."""
    from distributed.comm import tcp

    traffic = dask_scheduler.lic_traffic = {"messages": 0, "bytes": 0}
    read, write, read_bytes = tcp.TCP.read, tcp.TCP.write, tcp.read_bytes_rw

    async def counting_read(self: Any, *args: Any, **kwargs: Any) -> Any:
        message = await read(self, *args, **kwargs)
        traffic["messages"] += 1
        return message

    async def counting_write(self: Any, *args: Any, **kwargs: Any) -> Any:
        size = await write(self, *args, **kwargs)
        traffic["messages"] += 1
        traffic["bytes"] += size
        return size

    async def counting_read_bytes(stream: Any, size: int) -> Any:
        traffic["bytes"] += size
        return await read_bytes(stream, size)

    tcp.TCP.read, tcp.TCP.write, tcp.read_bytes_rw = (
        counting_read,
        counting_write,
        counting_read_bytes,
    )


def look(dask_scheduler: Any) -> dict[str, float]:
    """Runs in the scheduler."""
    return {"cpu_s": time.process_time(), **dask_scheduler.lic_traffic}


def measure(client: Any, tasks: int, run: Callable[[], object]) -> Cost:
    """Runs tasks and returns what they took."""
    before, wall, collector = (
        client.run_on_scheduler(look),
        time.perf_counter(),
        time.process_time(),
    )
    run()
    wall, collector = time.perf_counter() - wall, time.process_time() - collector
    after = client.run_on_scheduler(look)
    used = {name: after[name] - before[name] for name in before}
    return Cost(tasks, wall, used.pop("cpu_s"), collector, used)


def measure_all(tasks: int) -> tuple[dict[int, Cost], dict[str, Cost]]:
    """Returns the costs of idling with some workers, and those of tasks with two of them."""
    from distributed import Client
    from distributed.deploy.subprocess import SubprocessCluster

    from scripts.scheduler.run import instant, instant_reach  # As the workers know them.

    scenario = ExperienceLibrary(shipped_library("cylinder-clutter")).scenario()
    with (
        SubprocessCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as local,
        Client(local, set_as_default=False) as client,
        DaskWorkers(local.scheduler_address) as cluster,
        TemporaryDirectory() as folder,
    ):
        client.wait_for_workers(2)

        def fill(environments: int, **grid: Any) -> None:
            request = CollectionRequest(scenario=scenario, environments=environments, **grid)
            library = ExperienceLibrary(Path(folder) / f"{environments}")
            collect(library, request, cluster, reach=instant_reach)

        fill(4)  # The workers import what they need.
        client.run_on_scheduler(count_traffic)
        idle = {2: measure(client, IDLE_S, lambda: time.sleep(IDLE_S))}
        costs = {
            "`client.submit` of an instant function": measure(
                client,
                tasks,
                lambda: client.gather([client.submit(instant, i) for i in range(tasks)]),
            ),
            ONE: measure(client, tasks // 4, lambda: fill(tasks // 4, max_goals=1, max_starts=1)),
            ALL: measure(client, 20, lambda: fill(20)),
        }
        local.scale(10)
        client.wait_for_workers(10)
        time.sleep(IDLE_S)
        idle[10] = measure(client, IDLE_S, lambda: time.sleep(IDLE_S))
    return idle, costs


def disk_section() -> list[str]:
    library = ExperienceLibrary(shipped_library("cylinder-clutter"))
    records = library.records()
    shard = sum(path.stat().st_size for path in library.shard_paths()) / len(records)
    return [
        "## Disk",
        "",
        f"From the {len(records)} reaches of the shipped library:",
        "",
        "| | bytes per reach | |",
        "|---|---|---|",
        f"| shard (Parquet) | {shard:.0f} | {shard * MILLION / 1e6:.0f} MB a million |",
    ]


def task_section(idle: dict[int, Cost], costs: dict[str, Cost]) -> list[str]:
    record_s = 2 * costs[ALL].wall_s / costs[ALL].tasks / PER_TASK
    return [
        "## Tasks",
        "",
        "Two workers, reaches that take no time, so that only the rest is measured. Messages and"
        " bytes are all that pass the scheduler, in both directions, heartbeats included.",
        "",
        "| | tasks | tasks/s | scheduler CPU, ms/task | collector CPU, ms/task | messages/task"
        " | bytes/task |",
        "|---|---|---|---|---|---|---|",
        *(
            f"| {name} | {cost.tasks} | {cost.tasks / cost.wall_s:.0f}"
            f" | {1e3 * cost.scheduler_s / cost.tasks:.2f}"
            f" | {1e3 * cost.collector_s / cost.tasks:.2f}"
            f" | {cost.traffic['messages'] / cost.tasks:.1f}"
            f" | {cost.traffic['bytes'] / cost.tasks:.0f} |"
            for name, cost in costs.items()
        ),
        "",
        f"A reach takes {1e3 * record_s:.2f} ms beside its simulation.",
        "",
        "| idle workers | scheduler CPU, ms/s | messages/s |",
        "|---|---|---|",
        *(
            f"| {n} | {1e3 * cost.scheduler_s / cost.tasks:.1f}"
            f" | {cost.traffic['messages'] / cost.tasks:.1f} |"
            for n, cost in idle.items()
        ),
    ]


def saturation_section(idle: dict[int, Cost], cost: Cost, reach_s: float) -> list[str]:
    # Up to ten workers send two heartbeats a second each.
    heartbeat_s = (idle[10].scheduler_s - idle[2].scheduler_s) / (IDLE_S * 2 * (10 - 2))
    share = MAX_HEARTBEATS * heartbeat_s
    scheduler_s, collector_s = cost.scheduler_s / cost.tasks, cost.collector_s / cost.tasks
    busiest_s = max(scheduler_s / (1 - share), collector_s)
    return [
        "## Saturation",
        "",
        f"Computed, not tried: heartbeats ({1e3 * heartbeat_s:.2f} ms each, at most"
        f" {MAX_HEARTBEATS} a second from however many workers) take up to {share:.0%} of the"
        f" scheduler's core; what is left serves a task every"
        f" {1e3 * scheduler_s / (1 - share):.1f} ms, the collector one every"
        f" {1e3 * collector_s:.1f} ms. A task of n reaches keeps a worker busy for"
        f" n x {reach_s:.2g} s.",
        "",
        "| reaches a task | task, s | workers at saturation |",
        "|---|---|---|",
        *(f"| {n} | {n * reach_s:.3g} | {n * reach_s / busiest_s:,.0f} |" for n in (1, PER_TASK)),
    ]


def million_section(reach_s: float, price: float) -> list[str]:
    tasks = math.ceil(MILLION / PER_TASK)
    rows = []
    for cores in (100, math.ceil(tasks / 2), 1000, tasks):
        wall_h = math.ceil(tasks / cores) * PER_TASK * reach_s / 3600
        ideal_h = MILLION * reach_s / cores / 3600
        rows.append(
            f"| {cores} | {60 * wall_h:.1f} | {60 * ideal_h:.1f} | {wall_h * cores * price:.2f} |"
        )
    return [
        "## A million reaches",
        "",
        f"{MILLION:,} x {reach_s:.2g} s = {MILLION * reach_s / 3600:.1f} core hours, in {tasks}"
        f" tasks of {PER_TASK * reach_s:.0f} s. Wall time = ceil(tasks / cores) x task; cost ="
        " cores x wall time x price, idle cores paid to the end. The price is an assumption:"
        f" {price:g} USD per core hour (a spot machine); --price changes it.",
        "",
        "| cores | wall time, min | were tasks divisible, min | cost, USD |",
        "|---|---|---|---|",
        *rows,
    ]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--tasks", type=int, default=2000)
    parser.add_argument("--reach-s", type=float, help="wall time of a reach, seconds")
    parser.add_argument("--price", type=float, default=0.04, help="USD per core hour, assumed")
    args = parser.parse_args()
    library = ExperienceLibrary(shipped_library("cylinder-clutter"))
    reach_s = args.reach_s or float(library.columns()["wall_time_s"].mean())
    idle, costs = measure_all(args.tasks)
    sections = [
        [
            "# Scaling",
            "",
            f"Measured by `python scripts/scheduler/run.py` on {os.cpu_count()} cores; a reach"
            f" is taken to last {reach_s:.3g} s ("
            + ("given as --reach-s" if args.reach_s else "mean wall time in the shipped library")
            + ").",
        ],
        disk_section(),
        task_section(idle, costs),
        saturation_section(idle, costs[ONE], reach_s),
        million_section(reach_s, args.price),
    ]
    print("\n\n".join("\n".join(section) for section in sections))
    return 0


if __name__ == "__main__":
    sys.exit(main())
