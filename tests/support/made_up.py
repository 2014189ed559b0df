"""Small libraries, made up or parts of the shipped ones: no reach is simulated."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.compute as pc

from lic_drake.experience.collect import REQUEST_FILE, CollectionRequest, write_request
from lic_drake.experience.schema import read_shard, write_table
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.paths import shipped_library
from lic_drake.reach.scenario import Scenario, load_scenario
from support.fake_reach import make_record, make_request

BRIEF = "stop: {timeout_s: 0.2}"
NARROW = "task: {stand: {y_min_m: -0.1, y_max_m: 0.1, torso_min_m: 0.1, torso_max_m: 0.2}}"
"""Nine places of the PR2's base and torso in the grid instead of 49."""


def planar_library(path: Path, scenario: Scenario) -> ExperienceLibrary:
    """A library of the planar arm: starts to the left of the base succeed."""
    library = ExperienceLibrary(path)
    request = make_request(scenario=scenario, environments=2, max_goals=3, max_starts=None)
    for environment in request.environment_indices:
        records = [
            replace(make_record(item), success=bool(item.start.x0[1] > item.start.b0[1]))
            for item in request.reaches(environment)
        ]
        library.write_shard(f"training-{environment}", records, scenario)
    return library


def part_of_shipped(
    path: Path, category: str, environments: int, least_y: float = -1.0
) -> ExperienceLibrary:
    """The first environments of a shipped library, with all goals or those far to the left."""
    path.mkdir()
    for shard in ExperienceLibrary(shipped_library(category)).shard_paths():
        table = read_shard(shard)[1]
        far = pc.field("goal_y") >= least_y
        part = table.filter((pc.field("environment") < environments) & far)
        if len(part):
            write_table(part, path / shard.name)
    return ExperienceLibrary(path)


def sphere_library(path: Path) -> ExperienceLibrary:
    """A library of short reaches of the PR2: those from apertures near the goal succeed."""
    scenario = load_scenario("sphere-aperture-clutter", f"{{{BRIEF}, {NARROW}}}")
    library = ExperienceLibrary(path)
    request = CollectionRequest(scenario=scenario, environments=1, max_goals=4)
    for environment in request.environment_indices:
        records = []
        for item in request.reaches(environment):
            apart = np.hypot(item.start.x0[1] - item.goal[1], item.start.x0[2] - item.goal[2])
            records.append(replace(make_record(item), success=bool(apart < 0.2)))
        library.write_shard(f"training-{environment:06d}", records, scenario)
    write_request(request, library.path / REQUEST_FILE)
    return library


def small_cameras(path: Path) -> Path:
    """Writes the shipped cameras with a quarter of the pixels."""
    small = "{camera: {width: 320, height: 240, focal_px: 262.5}}"
    path.write_text(f"head: {small}\nexternal: {small}\n")
    return path
