"""What takes seconds to work out is kept in files, as plain arrays, and found again.

A file's name has a digest of all that the arrays depend on, the code that makes them included.
Nothing is unpickled, and a damaged or foreign file only costs the work again, and a line.
"""

import hashlib
import os
import platform
import tempfile
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from lic_drake.errors import remark

VARIABLE = "LIC_CACHE"
"""Environment variable with the folder of what is kept, or "off"."""

type Arrays = dict[str, NDArray[Any]]
"""Arrays by name."""

_NAME = "kept_as"


def cache_folder() -> Path | None:
    """Returns the folder of what is kept, by default in the user's cache; None if switched off."""
    named = os.environ.get(VARIABLE, "")
    home = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    return None if named == "off" else Path(named or home, "" if named else "lic_drake")


def kept_path(
    name: str, code: Iterable[Path], identity: object, arrays: Iterable[NDArray[Any]] = ()
) -> Path | None:
    """Returns where something is kept; None if nothing is.

    Args:
        name: First part of the file's name.
        code: Files of the code that works it out.
        identity: What it depends on; its repr tells all of it.
        arrays: Arrays that it depends on, too.
    """
    folder = cache_folder()
    if folder is None:
        return None
    digest = hashlib.blake2b(digest_size=16)
    made_by = (np.__version__, scipy.__version__, platform.machine())
    digest.update(repr((name, identity, made_by)).encode())
    for path in code:
        digest.update(path.read_bytes())
    for array in arrays:
        digest.update(
            f"{array.dtype}{array.shape}".encode() + np.ascontiguousarray(array).tobytes()
        )
    return folder / f"{name}-{digest.hexdigest()}.npz"


def read_kept[T](
    path: Path, understand: Callable[[Arrays], T], what: str, say: Callable[[str], None] = remark
) -> T | None:
    """Returns what a kept file means, or None if there is none or it is damaged.

    Args:
        path: See `kept_path`.
        understand: Makes it of the arrays; any exception of its says what is wrong with them.
        what: What is kept, in a word for `say`, which receives a line about a damaged file.
        say: Receives messages.
    """
    try:
        with np.load(path) as file:  # Which refuses objects, and compares checksums.
            arrays = dict(file)
        if str(arrays.pop(_NAME)) != path.name:
            raise ValueError("it was kept under another name")
        return understand(arrays)
    except FileNotFoundError:
        return None
    except Exception as error:  # Whatever is wrong with the file, it only costs the work again.
        say(f"lic: ignored the kept {what} {path}: {' '.join(str(error).split())}")
        return None


def keep(
    path: Path, arrays: Mapping[str, Any], what: str, say: Callable[[str], None] = remark
) -> None:
    """Writes arrays, atomically; `say` receives a line if that fails."""
    temporary = None
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        # Several processes may work out the same at a time.
        with tempfile.NamedTemporaryFile(dir=path.parent, suffix=".tmp", delete=False) as file:
            temporary = file.name
            named: dict[str, Any] = {_NAME: path.name, **arrays}
            np.savez(file, **named)
        os.replace(temporary, path)
    except OSError as error:
        if temporary is not None:
            Path(temporary).unlink(missing_ok=True)
        say(f"lic: cannot keep the {what} in {path.parent}: {error.strerror}; set {VARIABLE}")
