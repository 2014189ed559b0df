"""The notebooks run, from made-up records and from the committed ones, and hold no outputs."""

from collections.abc import Iterator
from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient
from trial_rows import fill_records

from lic_drake.evaluate.paper import REMARKS, TABLES

NOTEBOOKS = Path(__file__).resolve().parent.parent / "notebooks"
NAMES = ["tables", "figures"]
RECORDS = [
    *(f"{category}/trials.parquet" for category in TABLES),
    "learning_curve/learning_curve.csv",
    "cross_validation/calibration_curves.csv",
]


def read(name: str) -> nbformat.NotebookNode:
    return nbformat.read(NOTEBOOKS / f"{name}.ipynb", as_version=4)


def run(name: str, folder: Path) -> nbformat.NotebookNode:
    """Returns the notebook with the outputs it has when run in a folder."""
    notebook = read(name)
    NotebookClient(
        notebook, timeout=120, kernel_name="python3", resources={"metadata": {"path": folder}}
    ).execute()
    return notebook


def outputs(notebook: nbformat.NotebookNode, kind: str) -> Iterator[str]:
    """Yields everything of a MIME type that the notebook shows."""
    for cell in notebook.cells:
        for output in cell.get("outputs", []):
            if kind in output.get("data", {}):
                yield output["data"][kind]


def code(notebook: nbformat.NotebookNode) -> list[str]:
    return [cell.source for cell in notebook.cells if cell.cell_type == "code"]


def test_all_notebooks_are_tested() -> None:
    assert {path.stem for path in NOTEBOOKS.glob("*.ipynb")} == set(NAMES)


@pytest.mark.parametrize("name", NAMES)
def test_notebooks_are_committed_without_outputs(name: str) -> None:
    for cell in read(name).cells:
        assert not cell.get("outputs")
        assert cell.get("execution_count") is None


@pytest.mark.parametrize("name", NAMES)
def test_notebooks_hold_no_logic(name: str) -> None:
    assert not any(word in text for text in code(read(name)) for word in ("def ", "if ", "while "))


def test_the_tables_are_shown(tmp_path: Path) -> None:
    fill_records(tmp_path / "results")
    notebook = run("tables", tmp_path)
    shown = list(outputs(notebook, "text/markdown"))
    assert [text.split(".")[0] for text in shown if text.startswith("Table")] == [
        "Table I",
        "Table II",
        "Table III",
        "Table IV",
    ]
    assert len(shown) == 7
    assert notebook.cells[-1].outputs[0].text.count("\n") == len(REMARKS)


def test_the_figures_are_shown(tmp_path: Path) -> None:
    fill_records(tmp_path / "results")
    notebook = run("figures", tmp_path)
    drawn = [text for text in code(notebook) if "_figure(" in text]
    assert len(list(outputs(notebook, "image/png"))) == len(drawn) == 13


@pytest.mark.parametrize("name", NAMES)
def test_notebooks_run_from_the_committed_records(name: str) -> None:
    missing = [record for record in RECORDS if not (NOTEBOOKS / "results" / record).exists()]
    if missing:
        pytest.skip(f"notebooks/results/{missing[0]} is not there yet")
    run(name, NOTEBOOKS)
