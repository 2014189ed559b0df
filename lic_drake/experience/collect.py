"""`collect`: simulates every goal from every start in a number of environments (paper IV-A).

The request is stored beside the shards as a YAML file, so that a collection can be resumed or
extended without repeating its options.
"""

import re
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from filelock import FileLock
from numpy.typing import NDArray

from lic_drake.config import read_mapping
from lic_drake.errors import LibraryError, RequestError, quoted, readable_errors
from lic_drake.experience.runner import Progress, simulate_locked
from lic_drake.experience.schema import write_atomically
from lic_drake.experience.store import ExperienceLibrary, parse_same_scenario
from lic_drake.experience.workers import Workers
from lic_drake.reach.request import ReachRequest
from lic_drake.reach.scenario import Scenario
from lic_drake.reach.start import Starts
from lic_drake.seeds import STREAMS
from lic_drake.starts import training_starts
from lic_drake.types import Vector

REQUEST_FILE = "_collection.yaml"
"""File name of the request in a library; the underscore hides it from Parquet readers."""


@dataclass(frozen=True, kw_only=True)
class CollectionRequest:
    """Every goal from every start of a scenario's task, in some environments of a seed stream.

    `max_goals` and `max_starts` thin the grids evenly to at most that many; None: all. Values out
    of range raise a RequestError.
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
            ("environments", 1, 1_000_000),
            ("max_goals", 1, 1_000_000),
            ("max_starts", 1, 1_000_000),
        ):
            value = getattr(self, name)
            if value is not None and value not in range(low, high + 1):
                raise RequestError(f"{name} must be from {low} to {high}, got {value}")

    @property
    def environment_indices(self) -> range:
        """Indices of the environments in their stream."""
        return range(self.first_environment, self.first_environment + self.environments)

    def goals(self, environment: int | None = None) -> Vector:
        """Returns the goals p_WG in an environment (by default the first), shape (n, 3), metres."""
        index = self.first_environment if environment is None else environment
        return _subsample(self.scenario.goals(self.stream, index), self.max_goals)

    def starts(self, environment: int | None = None) -> Starts:
        """Returns the initial conditions in an environment, by default the first."""
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

    def environments_of(self, share: str) -> range:
        """Returns the indices of a share "k/n": every n-th environment from the k-th."""
        match = re.fullmatch(r"(\d+)/(\d+)", share)
        index, count = map(int, match.groups()) if match else (0, 0)
        if not 1 <= index <= count:
            raise RequestError(
                f"a share is k/n with k from 1 to n, for instance 3/20, got {quoted(share)}"
            )
        return self.environment_indices[index - 1 :: count]

    def all_reaches(self, share: str = "1/1") -> Iterator[ReachRequest]:
        """Yields the reaches of a share, environment by environment."""
        for environment in self.environments_of(share):
            yield from self.reaches(environment)

    def num_reaches(self, share: str = "1/1") -> int:
        """Returns the number of reaches of a share."""
        environments = self.environments_of(share)
        if self.scenario.task.stand is None:
            return len(self.goals()) * len(self.starts()) * len(environments)
        return sum(len(self.goals(i)) * len(self.starts(i)) for i in environments)


def collect(
    library: ExperienceLibrary,
    request: CollectionRequest,
    workers: Workers | None = None,
    *,
    share: str = "1/1",
    **options: Any,
) -> Progress:
    """Simulates the reaches of a request that a library lacks; options and errors as `simulate`.

    An existing library accepts only its own request, or that with more environments.
    """
    library.create()
    with library.locked(share):
        # All shares of a job array may start at the same time.
        with FileLock(library.path / "_collection.lock"):
            _record_request(library, request)
        reaches, total = request.all_reaches(share), request.num_reaches(share)
        return simulate_locked(reaches, library, workers, total=total, **options)


def _record_request(library: ExperienceLibrary, request: CollectionRequest) -> None:
    """Stores a request in a library unless that belongs to a different one."""
    path = library.path / REQUEST_FILE
    if path.exists():
        held = read_request(path)
        if held == request:
            return
        larger = max(held.environments, request.environments)
        ours, theirs = _values(request), _values(replace(held, environments=larger))
        differing = [f"{k} {theirs[k]} instead of {ours[k]}" for k in ours if theirs[k] != ours[k]]
        if differing:
            raise LibraryError(
                f"{library.path} was begun with {', '.join(differing)}; resume with the same"
                " options (or none), or use another folder"
            )
    library.check_scenario(request.scenario, "the collection")
    write_request(request, path)


def write_request(request: CollectionRequest, path: Path) -> None:
    """Writes a request as YAML, including the whole scenario."""
    content = "# What `lic collect` puts into this folder; seeds and values are complete.\n"
    data = {**_values(request), "scenario": asdict(request.scenario)}
    content += yaml.safe_dump(data, sort_keys=False)
    write_atomically(path, lambda temporary: temporary.write_text(content, encoding="utf-8"))


def read_request(path: Path) -> CollectionRequest:
    """Reads a request from YAML; raises a LicError if it is none or has invalid values."""
    with readable_errors(path, "read"):
        data = read_mapping(path.read_bytes(), str(path))
    try:
        digest, scenario = data.pop("scenario_digest"), yaml.safe_dump(data.pop("scenario"))
        same = parse_same_scenario(scenario, digest, path)
        return CollectionRequest(scenario=same, **data)
    except (KeyError, TypeError, RequestError) as error:
        raise LibraryError(
            f"{path} is not a collection request ({error}); restore it, or delete it and run lic"
            " collect with the library's options"
        ) from None


def _values(request: CollectionRequest) -> dict[str, Any]:
    """Returns a request as plain values, the scenario as its digest."""
    values = dict(vars(request))
    return {"scenario_digest": values.pop("scenario").digest, **values}


def _subsample[T: np.generic](grid: NDArray[T], count: int | None) -> NDArray[T]:
    """Returns at most `count` rows: the middles of as many equal parts of a grid."""
    if count is None or count >= len(grid):
        return grid
    middles = ((np.arange(count) + 0.5) * len(grid) / count).astype(int)
    return np.take(grid, middles, axis=0)
