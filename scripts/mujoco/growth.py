"""How the cost of a reach grows: with cylinders, taxels and worker processes."""

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import groupby

import numpy as np

from lic_drake.control.taxels import make_taxels
from lic_drake.evaluate.trial import random_requests
from lic_drake.experience.workers import LocalWorkers
from lic_drake.reach.request import ReachRequest, is_within_reach
from lic_drake.reach.scenario import Scenario
from scripts.mujoco.engines import Engine
from scripts.mujoco.tables import engine_cost, make_table
from scripts.mujoco.timing import time_paired

Clock = Callable[[], float]
Say = Callable[[str], None]


def draw_requests(
    scenario: Scenario, stream: str, environments: int, goals: int
) -> list[ReachRequest]:
    """Returns the random reaches of some environments whose goals the arm can reach."""
    requests = random_requests(scenario, stream, environments, goals)
    return [r for r in requests if is_within_reach(scenario, np.array(r.goal))]


def cylinders_table(
    scenario: Scenario,
    stream: str,
    counts: Sequence[int],
    reaches: int,
    engines: Sequence[Engine],
    clock: Clock,
    say: Say,
) -> str:
    """One line a number of cylinders, half of them movable, in the scenario's rectangle."""
    lines = []
    for count in counts:
        clutter = replace(scenario.clutter, num_movable=count // 2, num_fixed=count - count // 2)
        crowded = replace(scenario, clutter=clutter)
        requests = draw_requests(crowded, stream, reaches, 2)[:reaches]
        rows = time_paired(crowded, requests, engines, clock, lambda line: None)
        say(f"  {count} cylinders: {len(requests)} reaches")
        lines.append([str(count), *_costs(rows, engines)])
    return make_table(["cylinders", *_cost_headings(engines)], lines)


def taxels_table(
    scenario: Scenario,
    requests: Sequence[ReachRequest],
    densities: Sequence[int],
    engines: Sequence[Engine],
    clock: Clock,
    say: Say,
) -> str:
    """One line a density of the skin, in taxels per metre."""
    lines = []
    for density in densities:
        scene = replace(scenario.scene, taxels_per_m=float(density))
        dense = replace(scenario, scene=scene)
        rows = time_paired(dense, requests, engines, clock, lambda line: None)
        say(f"  {density} taxels per metre: {len(requests)} reaches")
        number = make_taxels(scenario.arm(), scene.taxels_per_m).num_taxels
        lines.append([str(density), str(number), *_costs(rows, engines)])
    return make_table(["taxels per m", "taxels", *_cost_headings(engines)], lines)


def workers_table(
    scenario: Scenario,
    requests: Sequence[ReachRequest],
    workers: Sequence[int],
    engines: Sequence[Engine],
    say: Say,
) -> str:
    """One line an engine: reaches a minute of wall time with some numbers of processes."""
    lines = []
    for engine in engines:
        rates = []
        for count in workers:
            rates.append(60.0 * len(requests) / _time_pool(scenario, requests, count, engine))
            say(f"  {engine.name}, {count} workers: {rates[-1]:.0f} reaches a minute")
        lines.append([engine.name, *(f"{r:.0f}" for r in rates), f"{rates[-1] / rates[0]:.2f}"])
    headings = ["engine", *(f"reaches a minute, {count} workers" for count in workers)]
    return make_table([*headings, "last against first"], lines)


def _costs(rows: Sequence, engines: Sequence[Engine]) -> list[str]:
    return [f"{cost:.4f}" for engine in engines for cost in engine_cost(rows, engine.name)]


def _cost_headings(engines: Sequence[Engine]) -> list[str]:
    return [f"{engine.name}: {what}" for engine in engines for what in ("reach", "stepping")]


def _time_pool(
    scenario: Scenario, requests: Sequence[ReachRequest], workers: int, engine: Engine
) -> float:
    """Returns the wall seconds for all reaches, an environment a task, with warm processes."""
    tasks = [list(g) for _, g in groupby(requests, key=lambda r: (r.stream, r.environment))]
    with LocalWorkers(workers) as executor:
        first = [executor.submit(_run_task, engine, scenario, tasks[0][:1]) for _ in range(workers)]
        for future in first:
            future.result()
        began = time.perf_counter()
        for future in [executor.submit(_run_task, engine, scenario, task) for task in tasks]:
            future.result()
        return time.perf_counter() - began


def _run_task(engine: Engine, scenario: Scenario, requests: list[ReachRequest]) -> None:
    instance = scenario.sample_instance(requests[0].stream, requests[0].environment)
    reach = engine.prepare(scenario, instance)
    for request in requests:
        reach(request)
