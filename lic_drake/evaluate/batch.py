"""Lists of reaches on several processes, kept in a library and never simulated twice."""

import time
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context

from lic_drake.experience.store import ExperienceLibrary
from lic_drake.experience.workers import prepare_worker
from lic_drake.reach.request import ReachRecord, ReachRequest
from lic_drake.reach.rollout import run_reach
from lic_drake.reach.scenario import Scenario
from lic_drake.reach.starts import make_starts
from lic_drake.seeds import make_generator

CHUNK = 20
"""Reaches to a shard: what an interruption can lose at the most, for each worker."""


def random_requests(
    scenario: Scenario, stream: str, environments: int, goals: int
) -> list[ReachRequest]:
    """Returns reaches from random starts of the grid to random goals: RND's first attempts.

    Args:
        scenario: What to simulate.
        stream: Seed stream of environments, goals and starts.
        environments: Number of environments, from index 0.
        goals: Number of goals in each; of starts to its goal where an environment offers one.
    """
    requests = []
    for environment in range(environments):
        starts = make_starts(scenario, scenario.sample_instance(stream, environment)).grid
        for goal in range(goals):
            index = 0 if scenario.task.goal_area is None else goal
            p_WG = scenario.sample_goal(stream, environment, index)
            rng = make_generator(stream, "rnd", environment, goal)
            start = starts[int(rng.integers(len(starts)))]
            requests.append(ReachRequest(scenario, stream, environment, p_WG, start))
    return requests


def simulate_requests(
    requests: Sequence[ReachRequest],
    library: ExperienceLibrary,
    scenario: Scenario,
    workers: int,
    say: Callable[[str], None],
    reach: Callable[[ReachRequest], ReachRecord] = run_reach,
) -> dict[str, ReachRecord]:
    """Returns the records of requests by key, simulating those that the library lacks.

    Args:
        requests: What to simulate.
        library: Keeps the records; it exists.
        scenario: The scenario of all requests.
        workers: Number of processes.
        say: Gets a line for every chunk of reaches.
        reach: Simulates one of them; pickles.
    """
    records = {record.key: record for record in library.records()} if _has_rows(library) else {}
    missing = list({r.key: r for r in requests if r.key not in records}.values())
    missing.sort(key=lambda request: request.environment)
    chunks = [missing[i : i + CHUNK] for i in range(0, len(missing), CHUNK)]
    executor = ProcessPoolExecutor(
        workers, mp_context=get_context("forkserver"), initializer=prepare_worker
    )
    began = time.perf_counter()
    done = successes = 0
    try:
        for future in as_completed([executor.submit(_run_chunk, reach, chunk) for chunk in chunks]):
            rows = future.result()
            library.write_shard(f"reaches-{rows[0].key}", rows, scenario)
            records.update({row.key: row for row in rows})
            done += len(rows)
            successes += sum(row.success for row in rows)
            elapsed = time.perf_counter() - began
            say(
                f"  {done}/{len(missing)} reaches, {successes} at the goal,"
                f" {60 * done / elapsed:.0f} a minute,"
                f" {elapsed * (len(missing) - done) / done:.0f} s left; kept in {library.path}"
            )
    finally:
        executor.shutdown(cancel_futures=True)
    library.compact()
    return records


def _run_chunk(
    reach: Callable[[ReachRequest], ReachRecord], requests: list[ReachRequest]
) -> list[ReachRecord]:
    return [reach(request) for request in requests]


def _has_rows(library: ExperienceLibrary) -> bool:
    return bool(library.shard_paths())
