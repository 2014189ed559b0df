"""Shared by the scripts: command lines, reaches that are kept, tables and reports."""

import argparse
import os
import sys
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

from tqdm import tqdm

from lic_drake.errors import LibraryError, LicError
from lic_drake.evaluate.table import Table
from lic_drake.evaluate.trials import TrialTable, read_trials
from lic_drake.experience.runner import Progress, refuse_failed, simulate
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.experience.workers import LocalWorkers
from lic_drake.reach.request import ReachRecord, ReachRequest
from lic_drake.reach.session import run_reach

RESULTS = Path("notebooks/results")
"""Folder of all records, seen from the root of a checkout, where scripts are run."""


def make_parser(doc: str | None) -> argparse.ArgumentParser:
    """Returns a parser of command lines that describes a script by its docstring."""
    return argparse.ArgumentParser(
        description=doc, formatter_class=argparse.RawDescriptionHelpFormatter
    )


def add_results(parser: argparse.ArgumentParser) -> None:
    """Adds the option --results."""
    parser.add_argument("--results", type=Path, default=RESULTS, help="folder of all records")


def add_workers(parser: argparse.ArgumentParser) -> None:
    """Adds the option --workers."""
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)


def run_script(main: Callable[[], object]) -> None:
    """Runs a script; an error of the package becomes one line on stderr and exit code 2."""
    try:
        main()
    except LicError as error:
        print(f"error: {error}", file=sys.stderr)
        sys.exit(2)


def run_tables(write: Callable[[Path], list[Path]], doc: str | None) -> None:
    """Runs a script whose only option is the folder of all records, and prints what it writes."""
    parser = make_parser(doc)
    add_results(parser)
    args = parser.parse_args()
    run_script(lambda: print(*write(args.results), sep="\n"))


def keep_reaches(
    requests: Sequence[ReachRequest], folder: Path, workers: int, *, sleep: bool = True
) -> list[ReachRecord]:
    """Returns the records of requests, in their order; those that a folder holds are not run again.

    Args:
        requests: What to simulate, of one scenario.
        folder: Of the library that keeps the records, at the end as one file.
        workers: Number of processes.
        sleep: Whether untouched objects sleep.
    """
    library = ExperienceLibrary(folder)
    reach = run_reach if sleep else partial(run_reach, sleep=False)
    ordered = sorted(requests, key=lambda request: (request.stream, request.environment))
    with (
        LocalWorkers(workers) as pool,
        tqdm(desc=folder.name, total=len(ordered), unit="reaches") as bar,
    ):

        def show(progress: Progress) -> None:
            bar.update(progress.done - bar.n)

        refuse_failed(simulate(ordered, library, pool, reach=reach, progress=show).failed)
    library.compact()
    found = {record.key: record for record in library.records()}
    return [found[request.key] for request in requests]


def load_trials(results: Path, category: str) -> TrialTable:
    """Returns the trials of an evaluation.

    Args:
        results: Folder of all records.
        category: Clutter category.

    Raises:
        LibraryError: There are none, or they cannot be read.
    """
    path = results / category / "trials.parquet"
    if not path.exists():
        raise LibraryError(
            f"no trials at {path}; make them with lic evaluate, see scripts/run_evaluation.sh"
        )
    return TrialTable(read_trials(path))


def write_tables(results: Path, name: str, tables: Sequence[Table]) -> list[Path]:
    """Writes tables as one Markdown and one LaTeX file and returns the files.

    Args:
        results: Folder of all records; the files go into its folder `tables`.
        name: Of the files, without suffix.
        tables: What to write, in this order.
    """
    folder = results / "tables"
    folder.mkdir(parents=True, exist_ok=True)
    texts = {
        folder / f"{name}.md": "\n".join(table.to_markdown() for table in tables),
        folder / f"{name}.tex": "\n".join(table.to_latex() for table in tables),
    }
    for path, text in texts.items():
        path.write_text(text, encoding="utf-8")
    return list(texts)


def write_report(path: Path | None, text: str) -> None:
    """Prints a report, and writes it to a file if one is named."""
    print(text, end="")
    if path is not None:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
