"""Reports on a library: its contents, its faults, and whether its rows can be reproduced."""

from collections import Counter
from collections.abc import Iterator
from dataclasses import fields
from typing import Any

import numpy as np

from lic_drake.errors import LibraryError
from lic_drake.experience.collect import CollectionRequest
from lic_drake.experience.runner import ReachFunction
from lic_drake.experience.schema import read_shard
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.intervals import wilson_interval
from lic_drake.reach.request import SIMULATION, ReachRecord, ReachRequest
from lic_drake.reach.session import run_reach

NOT_COMPARED = ("wall_time_s", "lic_drake_version", "drake_version", "weight")
"""Fields that `recompute` ignores."""


def check_library(
    library: ExperienceLibrary, request: CollectionRequest | None = None
) -> dict[str, Any]:
    """Reads every file of a library in full and reports all faults, ready for JSON.

    Returns:
        `shards`, `reaches`: number of Parquet files, and of rows in the readable ones.
        `damaged`: reasons by name of unreadable files; `scenarios`: digests, more than one is an
        error; `duplicates`: keys. `requested`, `missing`: numbers of reaches (None without a
        request); `incomplete`: indices of the environments that lack some.
        `is_sound`: whether there is none of these faults.
    """
    damaged: dict[str, str] = {}
    scenarios: set[str] = set()
    keys: Counter[str] = Counter()
    paths = library.shard_paths()
    for path in paths:
        try:
            header, table = read_shard(path)
        except LibraryError as error:
            damaged[path.name] = str(error)
            continue
        keys.update(table.column("key").to_pylist())
        scenarios.add(header["scenario_digest"])
    duplicates = sorted(key for key, count in keys.items() if count > 1)
    asked = [] if request is None else list(request.all_reaches())
    lacking = Counter(reach.environment for reach in asked if reach.key not in keys)
    return {
        "shards": len(paths),
        "reaches": keys.total(),
        "damaged": damaged,
        "scenarios": sorted(scenarios),
        "duplicates": duplicates,
        "requested": None if request is None else len(asked),
        "missing": None if request is None else lacking.total(),
        "incomplete": list(lacking),
        "is_sound": not (damaged or duplicates or lacking) and len(scenarios) <= 1,
    }


def recompute(
    library: ExperienceLibrary,
    count: int,
    rng: np.random.Generator,
    reach: ReachFunction = run_reach,
) -> Iterator[tuple[ReachRecord, ReachRecord, list[str]]]:
    """Simulates `count` random simulated rows again (at most all) and compares them bit for bit.

    Bitwise equality can only be expected on the machine that collected the library: other
    processors round differently, and contact amplifies small differences.

    Yields:
        A row, the row simulated again, and the names of the fields that differ.
    """
    scenario = library.scenario()
    rows = [row for row in library.records() if row.source == SIMULATION]
    drawn = [rows[i] for i in rng.choice(len(rows), min(count, len(rows)), replace=False)]
    # Diagrams are cached per environment.
    drawn.sort(key=lambda row: (row.stream, row.environment))
    names = [item.name for item in fields(ReachRecord) if item.name not in NOT_COMPARED]
    for row in drawn:
        again = reach(ReachRequest.from_record(row, scenario))
        # As text, so that NaN equals NaN.
        yield row, again, [n for n in names if repr(getattr(row, n)) != repr(getattr(again, n))]


def summarize(library: ExperienceLibrary) -> dict[str, Any]:
    """Summarizes a library, ready for JSON; all but `shards` and `added` is of simulated reaches.

    Returns:
        `environments`, `goals`, `starts`: numbers of distinct ones; `success_interval`: Wilson 90 %
        interval; `outcomes`: numbers of reaches, most frequent first; `added`: for each other
        source its rows, successes and weights.
    """
    scenario, columns = library.scenario(), library.columns()
    is_simulated = columns["source"] == SIMULATION
    simulated = {name: values[is_simulated] for name, values in columns.items()}
    reaches, successes = len(simulated["key"]), int(simulated["success"].sum())

    def count_distinct(*names: str) -> int:
        return len(set(zip(*(simulated[name] for name in names), strict=True)))

    added = {}
    for source in sorted(set(columns["source"]) - {SIMULATION}):
        rows = columns["source"] == source
        added[source] = {
            "reaches": int(rows.sum()),
            "successes": int(columns["success"][rows].sum()),
            "weights": sorted(set(columns["weight"][rows].tolist())),
        }
    return {
        "category": scenario.category,
        "robot": scenario.robot,
        "scenario": scenario.digest,
        "shards": len(library.shard_paths()),
        "reaches": reaches,
        "streams": sorted(set(simulated["stream"])),
        "environments": count_distinct("stream", "environment"),
        "goals": count_distinct("goal_x", "goal_y", "goal_z"),
        "starts": count_distinct("start_x", "start_y", "start_z", "start_phi"),
        "successes": successes,
        "success_rate": successes / reaches if reaches else float("nan"),
        "success_interval": wilson_interval(successes, reaches),
        "outcomes": dict(Counter(map(str, simulated["outcome"])).most_common()),
        "lic_drake_versions": sorted(set(simulated["lic_drake_version"])),
        "drake_versions": sorted(set(simulated["drake_version"])),
        "added": added,
    }
