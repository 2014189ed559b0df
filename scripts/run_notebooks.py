"""Runs notebooks in place and keeps their outputs, all but the large ones; or into a folder.

Usage: python scripts/run_notebooks.py [--out FOLDER] notebooks/2_one_reach.ipynb ...
"""

import argparse
import time
from pathlib import Path
from typing import Any

import nbformat
from nbclient import NotebookClient

MAX_OUTPUT_BYTES = 150_000
"""Larger outputs, embedded recordings, are left out; whoever runs the cell sees them."""


def run_notebook(path: Path) -> nbformat.NotebookNode:
    """Returns a notebook with the outputs that it has where it lies."""
    notebook: nbformat.NotebookNode = nbformat.read(path, as_version=4)  # type: ignore[no-untyped-call]
    where = {"metadata": {"path": path.parent}}
    NotebookClient(
        notebook,
        timeout=300,
        kernel_name="python3",
        resources=where,
        extra_arguments=["--log-level=ERROR"],  # Not that its sockets are those of this machine.
    ).execute()
    return notebook


def keep_small_outputs(notebook: nbformat.NotebookNode) -> None:
    """Takes out what is too large for the repository, or different in every run."""
    for cell in notebook.cells:
        cell.metadata.pop("execution", None)
        if cell.cell_type == "code":
            cell.outputs = [output for output in cell.outputs if _size(output) <= MAX_OUTPUT_BYTES]


def _size(output: Any) -> int:
    return len(str(output))


def main() -> None:
    """Runs the notebooks that the command line names."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("notebooks", nargs="+", type=Path, metavar="NOTEBOOK.ipynb")
    parser.add_argument(
        "--out",
        type=Path,
        metavar="FOLDER",
        help="write them there, with all outputs (default: in place, without the large ones)",
    )
    args = parser.parse_args()
    for path in args.notebooks:
        began = time.perf_counter()
        notebook = run_notebook(path)
        written = path
        if args.out is None:
            keep_small_outputs(notebook)
        else:
            args.out.mkdir(parents=True, exist_ok=True)
            written = args.out / path.name
        nbformat.write(notebook, written)  # type: ignore[no-untyped-call]
        seconds, size = time.perf_counter() - began, written.stat().st_size
        print(f"{written}: {seconds:.0f} s, {size / 1000:.0f} kB", flush=True)


if __name__ == "__main__":
    main()
