"""Fits are kept: what estimators chose from a library, in files, so that each is fitted once.

Choosing settings (hyper-parameters, bandwidths) takes seconds, and so does solving for the weights
of thousands of rows: both are kept, as plain arrays, and a fit with them is the same bit for bit. A
file is found by a digest of the rows themselves, of the features, and of the code that fits.
"""

import hashlib
import os
import platform
import tempfile
from collections import defaultdict
from collections.abc import Callable, Mapping
from dataclasses import astuple, fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from lic_drake.estimate.estimator import SuccessEstimator
from lic_drake.estimate.features import ExperienceRows, FeatureMap
from lic_drake.estimate.gaussian_process import GaussianProcess, Hyperparameters
from lic_drake.estimate.neighbours import NearestNeighbours
from lic_drake.estimate.registry import is_built_in

VARIABLE = "LIC_CACHE"
"""Environment variable with the folder of kept fits, or "off"."""

_SOLUTION = "solution_"
_KINDS = {kind.__name__: kind for kind in (GaussianProcess, Hyperparameters, NearestNeighbours)}
_CODE = [*sorted(Path(__file__).parent.glob("*.py")), Path(__file__).parents[1] / "seeds.py"]


def cache_folder() -> Path | None:
    """Returns the folder of kept fits, by default in the user's cache; None if switched off."""
    named = os.environ.get(VARIABLE, "")
    home = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    return None if named == "off" else Path(named or home, "" if named else "lic_drake")


def kept_path(name: str, features: FeatureMap, rows: ExperienceRows) -> Path | None:
    """Returns where the fit of a registered estimator to rows is kept.

    None if nothing is kept, or if others registered the estimator: no digest of this package could
    tell when their code has changed.
    """
    folder = cache_folder()
    if folder is None or not is_built_in(name):
        return None
    digest = hashlib.blake2b(digest_size=16)
    made_by = (np.__version__, scipy.__version__, platform.machine())
    digest.update(repr((name, features, made_by)).encode())
    for path in _CODE:
        digest.update(path.read_bytes())
    for array in astuple(rows):
        digest.update(
            f"{array.dtype}{array.shape}".encode() + np.ascontiguousarray(array).tobytes()
        )
    return folder / f"{name}-{digest.hexdigest()}.npz"


def fit_as_kept(
    path: Path, estimator: SuccessEstimator, rows: ExperienceRows, say: Callable[[str], None]
) -> bool:
    """Fits an estimator to rows with what was kept of such a fit; returns whether anything was.

    A damaged or foreign file is not trusted; `say` receives a line about it.
    """
    try:
        with np.load(path) as file:  # Which refuses objects, and compares checksums.
            arrays = dict(file)
        if str(arrays.pop("kept_as")) != path.name:
            raise ValueError("it was kept under another name")
        solution = arrays.pop(_SOLUTION, None)
        if {name.split(".")[0] for name in arrays} != set(estimator._chosen):
            raise ValueError(f"it holds {', '.join(arrays) or 'nothing'}")
        for name, array in arrays.items():
            if array.shape not in ((), rows.X.shape[1:]) or not np.all(np.isfinite(array)):
                raise ValueError(f"{name} has another shape, or is not finite")
        if solution is not None and not (solution.ndim == 1 and np.all(np.isfinite(solution))):
            raise ValueError("the solution has another shape, or is not finite")
        settings = _from_arrays(arrays)
    except FileNotFoundError:
        return False
    except Exception as error:  # Whatever is wrong with the file, it only costs a fit.
        say(f"lic: ignored the kept fit {path}: {' '.join(str(error).split())}")
        return False
    estimator.set_params(**settings)
    estimator.resume(rows.X, rows.y, sample_weight=rows.weight, solution=solution)
    return True


def keep_fit(path: Path, fitted: SuccessEstimator, say: Callable[[str], None]) -> None:
    """Writes what a fit has worked out, atomically; `say` receives a line if that fails."""
    temporary = None
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        # Several processes may fit the same at a time.
        with tempfile.NamedTemporaryFile(dir=path.parent, suffix=".tmp", delete=False) as file:
            temporary = file.name
            arrays: dict[str, Any] = {"kept_as": path.name, **_to_arrays(fitted.chosen)}
            if fitted.solution_ is not None:
                arrays[_SOLUTION] = fitted.solution_
            np.savez(file, **arrays)
        os.replace(temporary, path)
    except OSError as error:
        if temporary is not None:
            Path(temporary).unlink(missing_ok=True)
        say(f"lic: cannot keep the fit in {path.parent}: {error.strerror}; set {VARIABLE}")


def _to_arrays(values: Mapping[str, Any]) -> dict[str, NDArray[Any]]:
    """Returns values as arrays; those in a dataclass are called name.Class.field."""
    arrays: dict[str, NDArray[Any]] = {}
    for name, value in values.items():
        if is_dataclass(value):
            inner = _to_arrays({field.name: getattr(value, field.name) for field in fields(value)})
            kind = type(value).__name__
            arrays |= {f"{name}.{kind}.{path}": array for path, array in inner.items()}
        elif value is not None:  # The default of all that may be None.
            arrays[name] = np.asarray(value)
    return arrays


def _from_arrays(arrays: Mapping[str, NDArray[Any]]) -> dict[str, Any]:
    """Returns the values that `_to_arrays` turned into arrays."""
    values: dict[str, Any] = {}
    parts: defaultdict[tuple[str, str], dict[str, NDArray[Any]]] = defaultdict(dict)
    for path, array in arrays.items():
        name, *inner = path.split(".", 2)
        if inner:
            parts[name, inner[0]][inner[1]] = array
        else:
            values[name] = array if array.ndim else array.item()
    return values | {
        name: _KINDS[kind](**_from_arrays(part)) for (name, kind), part in parts.items()
    }
