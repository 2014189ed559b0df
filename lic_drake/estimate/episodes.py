"""Data sets of episodes in the layouts of LeRobot and robomimic, as a table with one row each."""

from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.dataset
import pyarrow.types as kinds

from lic_drake.errors import EstimateError, LibraryError

HDF5 = (".hdf5", ".h5")
"""Suffixes of robomimic's files."""

SUCCESS = "success"
"""Column that says whether an episode succeeded."""


def is_data_set(path: Path) -> bool:
    """Returns whether a path is a folder of LeRobot's layout or names a file of robomimic's."""
    return path.suffix in HDF5 or (path / "meta" / "info.json").is_file()


def read_episodes(path: Path) -> pa.Table:
    """Returns what each episode began with, and whether it succeeded.

    A column for each number of the first frame: those of a vector `observation.state` are
    observation.state_0, observation.state_1 and so on. Images, texts, vectors of different
    lengths, and what only some episodes have are left out. An episode succeeded if any of its
    frames did: `next.success` of LeRobot (versions 2 and 3), a positive reward of robomimic, whose
    tasks reward nothing else.

    Args:
        path: See `is_data_set`.

    Raises:
        LicError: It cannot be read, does not say what succeeded, or has no episodes.
    """
    table = _read_robomimic(path) if path.suffix in HDF5 else _read_lerobot(path)
    if not table.num_rows:
        raise EstimateError(f"{path} has no episodes; record some")
    return table


def _read_lerobot(folder: Path) -> pa.Table:
    try:
        frames = pyarrow.dataset.dataset(folder / "data", format="parquet")
        for name in ("episode_index", "frame_index", "next.success"):
            if name not in frames.schema.names:
                raise EstimateError(
                    f"the frames of {folder} have no column {name}; they have"
                    f" {', '.join(frames.schema.names)}"
                )
        names = [field.name for field in frames.schema if _is_numeric(field.type)]
        first = frames.to_table(names, pyarrow.dataset.field("frame_index") == 0)
        every = frames.to_table(["episode_index", "next.success"])
    except (OSError, pa.ArrowException) as error:
        reason = " ".join(str(error).split())[:200]
        raise LibraryError(f"cannot read the frames of {folder} ({reason})") from None
    columns: dict[str, Any] = {}
    for name in names:
        columns |= _numbered(name, first[name].to_pylist())
    if missing := len(every["episode_index"].unique()) - first.num_rows:
        raise EstimateError(f"{missing} episodes of {folder} have no frame 0; record them again")
    won = np.array(every["next.success"].to_pylist(), dtype=bool).reshape(every.num_rows)
    succeeded = np.unique(every["episode_index"].to_numpy()[won])
    return pa.table(columns | {SUCCESS: np.isin(columns["episode_index"], succeeded)})


def _is_numeric(kind: pa.DataType) -> bool:
    if kinds.is_list(kind) or kinds.is_fixed_size_list(kind) or kinds.is_large_list(kind):
        kind = kind.value_type
    return kinds.is_integer(kind) or kinds.is_floating(kind) or kinds.is_boolean(kind)


def _read_robomimic(path: Path) -> pa.Table:
    try:
        import h5py
    except ImportError:
        raise LibraryError(f"{path} needs h5py to be read: pip install h5py") from None
    first: dict[str, list[Any]] = {"demo": []}
    won: list[bool] = []
    try:
        with h5py.File(path) as file:
            # demo_10 comes after demo_9.
            for demo in sorted(file["data"], key=lambda name: int(name.rpartition("_")[2])):
                group = file["data"][demo]
                seen = {f"obs/{name}": values for name, values in group["obs"].items()}
                for name, values in (seen | {"actions": group["actions"]}).items():
                    if values.ndim <= 2 and values.dtype.kind in "fiub":
                        first.setdefault(name, []).append(values[0])
                first["demo"].append(int(demo.rpartition("_")[2]))
                won.append(bool(group["rewards"][:].max() > 0.0))
    except (OSError, KeyError, ValueError, IndexError, AttributeError, TypeError) as error:
        raise LibraryError(
            f"cannot read {path} ({error}); it needs data/demo_N with obs, actions and rewards, as"
            " robomimic's dataset_states_to_obs.py writes them"
        ) from None
    columns: dict[str, Any] = {}
    for name, values in first.items():
        if len(values) == len(won):  # What only some have is no column.
            columns |= _numbered(name, values)
    return pa.table(columns | {SUCCESS: np.array(won, dtype=bool)})


def _numbered(name: str, values: list[Any]) -> dict[str, Any]:
    """Returns columns of n numbers, or of n equally long vectors, by name; none of any others."""
    try:
        array = np.array(values)
    except ValueError:
        return {}
    if array.ndim == 1:
        return {name: array}
    return {f"{name}_{i}": column for i, column in enumerate(array.T)} if array.ndim == 2 else {}
