"""Measures what a collection costs beside its reaches: time of Dask's scheduler and the collector.

    python scripts/scheduler/run.py --out notebooks/results/scaling/README.md

Starts a scheduler and workers on this machine; reaches take no time, so that only the rest is
measured.
"""

import os
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from lic_drake.experience.collect import CollectionRequest, collect
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.experience.workers import DaskWorkers
from lic_drake.paths import shipped_library
from lic_drake.reach.request import ReachRecord, ReachRequest
from scripts.common import make_parser, run_script, write_report

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
    """

    tasks: int
    wall_s: float
    scheduler_s: float
    collector_s: float


def cpu_s() -> float:
    """Runs in the scheduler."""
    return time.process_time()


def measure(client: Any, tasks: int, run: Callable[[], object]) -> Cost:
    """Runs tasks and returns what they took."""
    scheduler = client.run_on_scheduler(cpu_s)
    wall, collector = time.perf_counter(), time.process_time()
    run()
    wall, collector = time.perf_counter() - wall, time.process_time() - collector
    return Cost(tasks, wall, client.run_on_scheduler(cpu_s) - scheduler, collector)


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


def report(idle: dict[int, Cost], costs: dict[str, Cost], reach_s: float) -> str:
    """Returns the costs as Markdown, and how many workers keep scheduler and collector busy."""
    # Up to ten workers send two heartbeats a second each.
    heartbeat_s = (idle[10].scheduler_s - idle[2].scheduler_s) / (IDLE_S * 2 * (10 - 2))
    share = MAX_HEARTBEATS * heartbeat_s
    rows = []
    for n, cost in ((1, costs[ONE]), (PER_TASK, costs[ALL])):
        scheduler_s = cost.scheduler_s / (1 - share) / cost.tasks
        collector_s = cost.collector_s / cost.tasks
        workers = n * reach_s / max(scheduler_s, collector_s)
        rows.append(
            f"| {n} | {n * reach_s:.3g} | {1e3 * scheduler_s:.1f} | {1e3 * collector_s:.1f}"
            f" | {workers:,.0f} |"
        )
    record_s = 2 * costs[ALL].wall_s / costs[ALL].tasks / PER_TASK
    lines = [
        "# Scaling",
        "",
        f"Measured by `python scripts/scheduler/run.py` on {os.cpu_count()} cores, two workers.",
        "",
        "| | tasks | tasks/s | scheduler CPU, ms/task | collector CPU, ms/task |",
        "|---|---|---|---|---|",
        *(
            f"| {name} | {cost.tasks} | {cost.tasks / cost.wall_s:.0f}"
            f" | {1e3 * cost.scheduler_s / cost.tasks:.2f}"
            f" | {1e3 * cost.collector_s / cost.tasks:.2f} |"
            for name, cost in costs.items()
        ),
        "",
        f"A reach takes {1e3 * record_s:.2f} ms beside its simulation. Idle workers cost the"
        " scheduler "
        + ", ".join(f"{1e3 * c.scheduler_s / c.tasks:.0f} ms/s ({n})" for n, c in idle.items())
        + ".",
        "",
        f"Computed, not tried: heartbeats take up to {share:.0%} of the scheduler's core. With"
        f" reaches of {reach_s:.2g} s both keep up with",
        "",
        "| reaches a task | task, s | scheduler, ms/task | collector, ms/task | workers |",
        "|---|---|---|---|---|",
        *rows,
    ]
    return "\n".join(lines) + "\n"


def main() -> None:
    parser = make_parser(__doc__)
    parser.add_argument("--tasks", type=int, default=2000)
    parser.add_argument("--out", type=Path, help="Markdown file")
    args = parser.parse_args()
    library = ExperienceLibrary(shipped_library("cylinder-clutter"))
    idle, costs = measure_all(args.tasks)
    write_report(args.out, report(idle, costs, float(library.columns()["wall_time_s"].mean())))


if __name__ == "__main__":
    run_script(main)
