"""`collect`: fills a library with every goal times every start, in some environments (paper IV-A).

What a library is to hold, a `CollectionRequest`, is kept beside its shards as a small YAML file,
so that a collection can go on, and grow, without being told again.
"""

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
"""Name of the request's file in a library; the underscore hides it from Parquet readers."""

MAX_ENVIRONMENTS = 1_000_000
"""More environments than this in one library are refused as a slip of the keyboard."""


@dataclass(frozen=True, kw_only=True)
class CollectionRequest:
    """All goals times all starts of a scenario's task, in some environments of a seed stream.

    Attributes:
        scenario: The scenario; its task gives the grids of goals and starts.
        stream: Seed stream of the environments.
        first_environment: Index of the first environment in its stream.
        environments: Number of environments.
        max_goals: Use at most this many goals of the grid, evenly thinned; None: all.
        max_starts: Use at most this many starts of the grid, evenly thinned; None: all.

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
        if not 0 <= self.first_environment < 2**31:
            raise RequestError(
                f"the first environment must be from 0 to 2^31 - 1, got {self.first_environment}"
            )
        if not 1 <= self.environments <= MAX_ENVIRONMENTS:
            raise RequestError(
                f"environments must be from 1 to {MAX_ENVIRONMENTS}, got {self.environments}"
            )
        for name in ("max_goals", "max_starts"):
            value = getattr(self, name)
            if value is not None and value < 1:
                raise RequestError(f"{name} must be 1 or more, got {value}")

    @property
    def environment_indices(self) -> range:
        """Indices of the environments in their stream."""
        return range(self.first_environment, self.first_environment + self.environments)

    def goals(self, environment: int | None = None) -> Vector:
        """Returns the goals p_WG in an environment, shape (n, 3), metres; n is the same in all.

        Args:
            environment: Its index in the stream; the first one by default.
        """
        index = self.first_environment if environment is None else environment
        return _thin(self.scenario.goals(self.stream, index), self.max_goals)

    def starts(self, environment: int | None = None) -> Starts:
        """Returns the m initial conditions in an environment.

        m is the same in all but where base and torso of a robot are not.

        Args:
            environment: Its index in the stream; the first one by default.

        Raises:
            RequestError: The arm can take no start pose.
        """
        index = self.first_environment if environment is None else environment
        starts = training_starts(self.scenario, self.stream, index)
        if len(starts) == 0:
            raise RequestError(
                f"{self.scenario.robot} can take no pose of the start line's grid;"
                " change task.start_line in the scenario"
            )
        return starts.take(_thin(np.arange(len(starts)), self.max_starts))

    def reaches(self, environment: int) -> list[ReachRequest]:
        """Returns the reaches into one environment; the starts vary fastest."""
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
    """Simulates the reaches of a request that are not yet in a library; see `simulate`.

    Args:
        library: A folder; made if absent.
        request: What the library is to hold. A library that was begun before takes only the same
            request, or one with more environments.
        workers: Where to simulate; by default in this process.
        share: The share of the environments to simulate.
        reach: Simulates a request.
        progress: Shows how far the collection is.

    Raises:
        LibraryError: The library belongs to another request, or as in `simulate`.
        ClusterError: As in `simulate`.
        KeyboardInterrupt: As in `simulate`.
    """
    library.create()
    # Shares of one collection begin at the same time.
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
    """Writes the request into the library, unless that was begun with another one."""
    path = library.path / REQUEST_FILE
    if path.exists():
        stored = read_request(path)
        _refuse_unless_continuing(request, stored, library.path)
        if stored.environments == request.environments:
            return
    if library.shard_paths() and library.header().scenario_digest != request.scenario.digest:
        raise LibraryError(
            f"{library.path} holds reaches of scenario {library.header().scenario_digest}, not of"
            f" {request.scenario.digest}; use another folder"
        )
    write_request(request, path)


def _refuse_unless_continuing(
    request: CollectionRequest, stored: CollectionRequest, path: Path
) -> None:
    """Refuses a request that differs from a library's own in more than more environments."""
    ours, theirs = _values(request), _values(stored)
    differences = [
        f"{name} {theirs[name]} instead of {ours[name]}"
        for name in ours
        if name != "environments" and theirs[name] != ours[name]
    ]
    if request.environments < stored.environments:
        differences.append(f"{stored.environments} environments, not {request.environments}")
    if differences:
        raise LibraryError(
            f"{path} was begun with {', '.join(differences)}; give the same options (or none) to"
            " go on, or another folder"
        )


def write_request(request: CollectionRequest, path: Path) -> None:
    """Writes a request as YAML, with every value of its scenario.

    Raises:
        LibraryError: The file cannot be written.
    """
    data = {**_values(request), "scenario": yaml.safe_load(scenario_text(request.scenario))}
    content = "# What `lic collect` puts into this folder; seeds and values are complete.\n"
    content += yaml.safe_dump(data, sort_keys=False)
    write_atomically(path, lambda temporary: _write_text(temporary, content))


def read_request(path: Path) -> CollectionRequest:
    """Reads a request from YAML.

    Raises:
        LibraryError: The file cannot be read or is not a request.
        RequestError: A value is out of its range.
        ScenarioError: Its scenario is not one that this lic_drake knows.
    """
    with readable_errors(path, "read"):
        content = path.read_bytes()
    try:
        data = read_mapping(content, str(path))
    except ScenarioError:
        data = {}
    if not _is_request(data):
        raise LibraryError(
            f"{path} is not a collection request; restore it, or delete it and run lic collect"
            " with the library's options"
        )
    digest = data.pop("scenario_digest")
    scenario = parse_scenario(yaml.safe_dump(data.pop("scenario")), source=str(path))
    if scenario.digest != digest:
        raise LibraryError(
            f"{path}: its scenario has digest {scenario.digest}, the library was begun with"
            f" {digest}: the file was edited or another lic_drake wrote it; use another folder"
        )
    return CollectionRequest(scenario=scenario, **data)


def _values(request: CollectionRequest) -> dict[str, Any]:
    """Returns a request as plain values, its scenario as digest."""
    names = [item.name for item in fields(request) if item.name != "scenario"]
    return {
        "scenario_digest": request.scenario.digest,
        **{name: getattr(request, name) for name in names},
    }


def _is_request(data: dict[Any, Any]) -> bool:
    """Returns whether parsed YAML has exactly the keys of a request with values of their types."""
    types: dict[str, tuple[type, ...]] = {
        "scenario_digest": (str,),
        "stream": (str,),
        "first_environment": (int,),
        "environments": (int,),
        "max_goals": (int, type(None)),
        "max_starts": (int, type(None)),
        "scenario": (dict,),
    }
    return set(data) == set(types) and all(type(data[key]) in types[key] for key in types)


def _write_text(path: Path, content: str) -> None:
    path.write_text(content, encoding="utf-8")


def _thin[T: np.generic](grid: NDArray[T], count: int | None) -> NDArray[T]:
    """Returns `count` rows from the middles of equal parts of a grid, or all of it."""
    if count is None or count >= len(grid):
        return grid
    middles = ((np.arange(count) + 0.5) * len(grid) / count).astype(int)
    return np.take(grid, middles, axis=0)
