"""Tables I to IV from the records of evaluations, as files."""

import argparse
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

from lic_drake.errors import LibraryError, LicError
from lic_drake.evaluate.paper import TABLES
from lic_drake.evaluate.table import Table
from lic_drake.evaluate.tables import margins_table, success_table, t_test_table
from lic_drake.evaluate.trials import TrialTable, read_trials
from lic_drake.experience.files import readable_errors, write_atomically

RESULTS = Path("notebooks/results")
"""Where records lie in a checkout: trials in <category>/trials.parquet."""

CATEGORIES = {
    1: "cylinder-clutter",
    2: "cylinder-clutter",
    3: "passage-clutter",
    4: "cylinder-aperture-clutter",
}
"""Clutter category of each table of the paper."""

_SIZES = {
    "cylinder-clutter": (200, 10),
    "passage-clutter": (2000, 1),
    "cylinder-aperture-clutter": (1000, 1),
}
"""Environments and goals in each, as many as in the paper."""


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
        environments, goals = _SIZES[category]
        raise LibraryError(
            f"no trials at {path}; make them with: lic evaluate {path.parent} --library"
            f" models/experience/{category} --environments {environments} --goals {goals}"
            " --attempts 2"
        )
    return TrialTable(read_trials(path))


def make_tables(results: Path, number: int) -> list[Table]:
    """Returns a table of the paper with our numbers, and LIC's margins with it.

    Args:
        results: Folder of all records.
        number: Number of the table in the paper, 1 to 4.

    Raises:
        LibraryError: The records are missing, damaged or incomplete.
    """
    category = CATEGORIES[number]
    trials = load_trials(results, category)
    if number == 2:
        return [t_test_table(trials)]
    paper = TABLES[category]
    return [success_table(trials, paper), margins_table(trials, paper)]


def write_tables(results: Path, number: int) -> list[Path]:
    """Writes a table of the paper as Markdown and LaTeX and returns the files.

    Raises:
        LibraryError: As `make_tables`, or the files cannot be written.
    """
    return write_table_files(results, f"table_{number}", make_tables(results, number))


def write_table_files(results: Path, name: str, tables: Sequence[Table]) -> list[Path]:
    """Writes tables as one Markdown and one LaTeX file and returns the files.

    Args:
        results: Folder of all records; the files go into its folder `tables`.
        name: Of the files, without suffix.
        tables: What to write, in this order.

    Raises:
        LibraryError: The files cannot be written.
    """
    folder = results / "tables"
    with readable_errors(folder, "create the folder"):
        folder.mkdir(parents=True, exist_ok=True)
    texts = {
        folder / f"{name}.md": "\n".join(table.to_markdown() for table in tables),
        folder / f"{name}.tex": "\n".join(table.to_latex() for table in tables),
    }
    for path, text in texts.items():
        _write(path, text)
    return list(texts)


def run_table_script(number: int, doc: str, arguments: Sequence[str] | None = None) -> int:
    """Runs the script of a table of the paper; see `run_script`."""
    return run_script(lambda results: write_tables(results, number), doc, arguments)


def run_script(
    write: Callable[[Path], list[Path]], doc: str, arguments: Sequence[str] | None = None
) -> int:
    """Runs a script that makes files from the records: parses, writes, names the files.

    Args:
        write: Takes the folder of all records, writes the files and returns them.
        doc: The script's docstring; its first line is the help.
        arguments: Command line; the process's own by default.

    Returns:
        The exit code.
    """
    parser = argparse.ArgumentParser(description=doc.splitlines()[0])
    parser.add_argument("--results", type=Path, default=RESULTS, help="folder of all records")
    args = parser.parse_args(arguments)
    try:
        paths = write(args.results)
    except LicError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    for path in paths:
        print(path)
    return 0


def _write(path: Path, text: str) -> None:
    def write(temporary: Path) -> None:
        temporary.write_text(text, encoding="utf-8")

    write_atomically(path, write)
