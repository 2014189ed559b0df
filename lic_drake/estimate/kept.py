"""Fits are kept: what estimators chose from a library, so that each is fitted once.

Choosing settings (hyper-parameters, bandwidths) takes seconds, and so does solving for the weights
of thousands of rows: both are kept, and a fit with them is the same bit for bit. A file is found by
the rows themselves, the features, and the code that fits.
"""

from collections import defaultdict
from collections.abc import Callable, Mapping
from dataclasses import astuple, fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np

from lic_drake.estimate.estimator import SuccessEstimator
from lic_drake.estimate.features import ExperienceRows, FeatureMap
from lic_drake.estimate.gaussian_process import GaussianProcess, Hyperparameters
from lic_drake.estimate.neighbours import NearestNeighbours
from lic_drake.estimate.registry import is_built_in
from lic_drake.kept import Arrays, keep, kept_path, read_kept
from lic_drake.types import Vector

_SOLUTION = "solution_"
_KINDS = {kind.__name__: kind for kind in (GaussianProcess, Hyperparameters, NearestNeighbours)}
_CODE = [*sorted(Path(__file__).parent.glob("*.py")), Path(__file__).parents[1] / "seeds.py"]


def fit_path(name: str, features: FeatureMap, rows: ExperienceRows) -> Path | None:
    """Returns where the fit of a registered estimator to rows is kept.

    None if nothing is kept, or if others registered the estimator: no digest of this package could
    tell when their code has changed.
    """
    return kept_path(name, _CODE, features, astuple(rows)) if is_built_in(name) else None


def fit_as_kept(
    path: Path, estimator: SuccessEstimator, rows: ExperienceRows, say: Callable[[str], None]
) -> bool:
    """Fits an estimator to rows with what was kept of such a fit; returns whether anything was.

    A damaged or foreign file is not trusted; `say` receives a line about it.
    """

    def understand(arrays: Arrays) -> tuple[dict[str, Any], Vector | None]:
        solution = arrays.pop(_SOLUTION, None)
        if {name.split(".")[0] for name in arrays} != set(estimator._chosen):
            raise ValueError(f"it holds {', '.join(arrays) or 'nothing'}")
        for name, array in arrays.items():
            if array.shape not in ((), rows.X.shape[1:]) or not np.all(np.isfinite(array)):
                raise ValueError(f"{name} has another shape, or is not finite")
        if solution is not None and not (solution.ndim == 1 and np.all(np.isfinite(solution))):
            raise ValueError("the solution has another shape, or is not finite")
        return _from_arrays(arrays), solution

    found = read_kept(path, understand, "fit", say)
    if found is None:
        return False
    estimator.set_params(**found[0])
    estimator.resume(rows.X, rows.y, sample_weight=rows.weight, solution=found[1])
    return True


def keep_fit(path: Path, fitted: SuccessEstimator, say: Callable[[str], None]) -> None:
    """Writes what a fit has worked out, atomically; `say` receives a line if that fails."""
    arrays: dict[str, Any] = {**_to_arrays(fitted.chosen)}
    if fitted.solution_ is not None:
        arrays[_SOLUTION] = fitted.solution_
    keep(path, arrays, "fit", say)


def _to_arrays(values: Mapping[str, Any]) -> Arrays:
    """Returns values as arrays; those in a dataclass are called name.Class.field."""
    arrays: Arrays = {}
    for name, value in values.items():
        if is_dataclass(value):
            inner = _to_arrays({field.name: getattr(value, field.name) for field in fields(value)})
            kind = type(value).__name__
            arrays |= {f"{name}.{kind}.{path}": array for path, array in inner.items()}
        elif value is not None:  # The default of all that may be None.
            arrays[name] = np.asarray(value)
    return arrays


def _from_arrays(arrays: Arrays) -> dict[str, Any]:
    """Returns the values that `_to_arrays` turned into arrays."""
    values: dict[str, Any] = {}
    parts: defaultdict[tuple[str, str], Arrays] = defaultdict(dict)
    for path, array in arrays.items():
        name, *inner = path.split(".", 2)
        if inner:
            parts[name, inner[0]][inner[1]] = array
        else:
            values[name] = array if array.ndim else array.item()
    return values | {
        name: _KINDS[kind](**_from_arrays(part)) for (name, kind), part in parts.items()
    }
