"""`collect`: simulates every goal from every start in a number of environments (paper IV-A).

The request is stored beside the shards as a YAML file, so that a collection can be resumed or
extended without repeating its options.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from filelock import FileLock
from numpy.typing import NDArray

from lic_drake.config import read_mapping
from lic_drake.errors import LibraryError, RequestError, ScenarioError
from lic_drake.experience.files import readable_errors, write_atomically
from lic_drake.experience.runner import Progress, ProgressFunction, ReachFunction, simulate
from lic_drake.experience.schema import scenario_text
from lic_drake.experience.store import WHOLE, ExperienceLibrary, Share
from lic_drake.experience.workers import Workers
from lic_drake.reach.request import ReachRequest
from lic_drake.reach.scenario import Scenario, parse_scenario
from lic_drake.reach.session import run_reach
from lic_drake.reach.start import Starts
from lic_drake.seeds import STREAMS
from lic_drake.starts import training_starts
from lic_drake.types import Vector

REQUEST_FILE = "_collection.yaml"
"""File name of the request in a library; the underscore hides it from Parquet readers."""

MAX_ENVIRONMENTS = 1_000_000
"""Larger numbers of environments are rejected as typing errors."""


@dataclass(frozen=True, kw_only=True)
class CollectionRequest:
    """Every goal from every start of a scenario's task, in some environments of a seed stream.

    Attributes:
        scenario: Defines the grids of goals and starts.
        stream: Seed stream of the environments.
        first_environment: Index of the first environment in its stream.
        environments: Number of environments.
        max_goals: Subsample the goal grid evenly to at most this many; None: all.
        max_starts: Subsample the start grid evenly to at most this many; None: all.

    Raises:
        RequestError: A value is out of its range.
    """

    scenario: Scenario
    stream: str = "training"
    first_environment: int = 0
    environments: int = 20
    max_goals: int | None = None
    max_starts: int | None = None

    def __post_init__(self) -> None:
        if self.stream not in STREAMS:
            raise RequestError(f"unknown stream {self.stream!r}; choose one of {list(STREAMS)}")
        for name, low, high in (
            ("first_environment", 0, 2**31 - 1),
            ("environments", 1, MAX_ENVIRONMENTS),
            ("max_goals", 1, math.inf),
            ("max_starts", 1, math.inf),
        ):
            value = getattr(self, name)
            if value is not None and not low <= value <= high:
                raise RequestError(f"{name} must be from {low} to {high}, got {value}")

    @property
    def environment_indices(self) -> range:
        """Indices of the environments in their stream."""
        return range(self.first_environment, self.first_environment + self.environments)

    def goals(self, environment: int | None = None) -> Vector:
        """Returns the goals p_WG in an environment (by default the first), shape (n, 3), metres.

        n is the same in all environments.
        """
        index = self.first_environment if environment is None else environment
        return _subsample(self.scenario.goals(self.stream, index), self.max_goals)

    def starts(self, environment: int | None = None) -> Starts:
        """Returns the initial conditions in an environment, by default the first.

        Raises:
            RequestError: No start pose is reachable.
        """
        index = self.first_environment if environment is None else environment
        starts = training_starts(self.scenario, self.stream, index)
        if len(starts) == 0:
            raise RequestError(
                f"{self.scenario.robot} can reach no pose of the start line's grid;"
                " change task.start_line in the scenario"
            )
        return starts.take(_subsample(np.arange(len(starts)), self.max_starts))

    def reaches(self, environment: int) -> list[ReachRequest]:
        """Returns the reaches in one environment; starts vary fastest."""
        starts = self.starts(environment)
        return [
            ReachRequest(self.scenario, self.stream, environment, p_WG, start)
            for p_WG in self.goals(environment)
            for start in starts
        ]

    def all_reaches(self, share: Share = WHOLE) -> Iterator[ReachRequest]:
        """Yields the reaches of a share, environment by environment."""
        for environment in share.of(self.environment_indices):
            yield from self.reaches(environment)

    def num_reaches(self, share: Share = WHOLE) -> int:
        """Returns the number of reaches of a share."""
        environments = share.of(self.environment_indices)
        if self.scenario.task.stand is None:
            return len(self.goals()) * len(self.starts()) * len(environments)
        return sum(len(self.goals(i)) * len(self.starts(i)) for i in environments)


def collect(
    library: ExperienceLibrary,
    request: CollectionRequest,
    workers: Workers | None = None,
    *,
    share: Share = WHOLE,
    reach: ReachFunction = run_reach,
    progress: ProgressFunction = lambda progress: None,
) -> Progress:
    """Simulates the reaches of a request that a library lacks; arguments and errors as `simulate`.

    An existing library accepts only its own request, or that with more environments.
    """
    library.create()
    # All shares of a job array may start at the same time.
    with library.locked(share), FileLock(library.path / "_collection.lock"):
        _record_request(library, request)
    return simulate(
        request.all_reaches(share),
        library,
        workers,
        total=request.num_reaches(share),
        share=share,
        reach=reach,
        progress=progress,
    )


def _record_request(library: ExperienceLibrary, request: CollectionRequest) -> None:
    """Stores a request in a library unless that belongs to a different one."""
    path = library.path / REQUEST_FILE
    if path.exists():
        ours, theirs = _values(request), _values(read_request(path))
        if request.environments > theirs["environments"]:
            theirs["environments"] = request.environments
        elif ours == theirs:
            return
        if different := [
            f"{k} {theirs[k]} instead of {ours[k]}" for k in ours if theirs[k] != ours[k]
        ]:
            raise LibraryError(
                f"{library.path} was begun with {', '.join(different)}; resume with the same"
                " options (or none), or use another folder"
            )
    if library.shard_paths() and library.header().scenario_digest != request.scenario.digest:
        raise LibraryError(
            f"{library.path} holds reaches of scenario {library.header().scenario_digest}, not of"
            f" {request.scenario.digest}; use another folder"
        )
    write_request(request, path)


def write_request(request: CollectionRequest, path: Path) -> None:
    """Writes a request as YAML, including the whole scenario."""
    data = {**_values(request), "scenario": yaml.safe_load(scenario_text(request.scenario))}
    content = "# What `lic collect` puts into this folder; seeds and values are complete.\n"
    content += yaml.safe_dump(data, sort_keys=False)
    write_atomically(path, lambda temporary: temporary.write_text(content, encoding="utf-8"))


def read_request(path: Path) -> CollectionRequest:
    """Reads a request from YAML.

    Raises:
        LibraryError: The file cannot be read or is not a request.
        RequestError: A value is out of range.
        ScenarioError: This lic_drake does not know the scenario's category or parameters.
    """
    with readable_errors(path, "read"):
        content = path.read_bytes()
    try:
        data = read_mapping(content, str(path))
    except ScenarioError:
        data = {}
    types: dict[str, Any] = {item.name: item.type for item in fields(CollectionRequest)}
    types |= {"scenario": dict, "scenario_digest": str}
    if set(data) != set(types) or not all(isinstance(data[k], t) for k, t in types.items()):
        raise LibraryError(
            f"{path} is not a collection request; restore it, or delete it and run lic collect"
            " with the library's options"
        )
    digest = data.pop("scenario_digest")
    scenario = parse_scenario(yaml.safe_dump(data.pop("scenario")), source=str(path))
    if scenario.digest != digest:
        raise LibraryError(
            f"{path}: its scenario has digest {scenario.digest}, but the library was begun with"
            f" {digest}: it was edited or another lic_drake wrote it; use another folder"
        )
    return CollectionRequest(scenario=scenario, **data)


def _values(request: CollectionRequest) -> dict[str, Any]:
    """Returns a request as plain values, the scenario as its digest."""
    names = [item.name for item in fields(request) if item.name != "scenario"]
    return {
        "scenario_digest": request.scenario.digest,
        **{name: getattr(request, name) for name in names},
    }


def _subsample[T: np.generic](grid: NDArray[T], count: int | None) -> NDArray[T]:
    """Returns at most `count` rows: the middles of as many equal parts of a grid."""
    if count is None or count >= len(grid):
        return grid
    middles = ((np.arange(count) + 0.5) * len(grid) / count).astype(int)
    return np.take(grid, middles, axis=0)
