"""The notebooks run, those of results from the committed records.

Notebooks of results are committed without outputs, because the records are; the others with small
ones, as `python scripts/run_notebooks.py` leaves them.
"""

import re
import resource
import time
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import nbformat
import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from nbclient import NotebookClient
from support.browser import assert_shows_a_scene, visit

from lic_drake.clutter.registry import category_names
from lic_drake.evaluate.paper import REMARKS
from scripts.common import load_trials
from scripts.tables.figures import FIGURES

NOTEBOOKS = Path(__file__).resolve().parent.parent / "notebooks"
NAMES = ["tables", "figures"]
"""Notebooks of results."""

TOURS = [
    "one_reach",
    "categories",
    "experience_library",
    "density_maps",
    "pr2_selection",
    "extend",
]
"""Notebooks that simulate, with the number of pictures and of recordings that they show."""

PICTURES = dict(zip(TOURS, [2, 3, 1, 3, 2, 1], strict=True))
RECORDINGS = dict(zip(TOURS, [1, 0, 0, 1, 1, 0], strict=True))

MAX_NOTEBOOK_BYTES = 200_000
MAX_SECONDS = 60.0


def read(name: str) -> nbformat.NotebookNode:
    return nbformat.read(NOTEBOOKS / f"{name}.ipynb", as_version=4)


def run(name: str, folder: Path) -> nbformat.NotebookNode:
    """Returns the notebook with the outputs it has when run in a folder."""
    notebook = read(name)
    for cell in notebook.cells:
        if cell.cell_type == "code":
            cell.outputs = []
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
    assert {path.stem for path in NOTEBOOKS.glob("*.ipynb")} == {*NAMES, *TOURS}


@pytest.mark.parametrize("name", NAMES)
def test_notebooks_are_committed_without_outputs(name: str) -> None:
    for cell in read(name).cells:
        assert not cell.get("outputs")
        assert cell.get("execution_count") is None


@pytest.mark.parametrize("name", TOURS)
def test_tours_are_committed_with_small_outputs_of_every_cell_that_has_any(name: str) -> None:
    assert (NOTEBOOKS / f"{name}.ipynb").stat().st_size < MAX_NOTEBOOK_BYTES
    notebook = read(name)
    assert len(list(outputs(notebook, "image/png"))) == PICTURES[name]
    assert all(cell.execution_count for cell in notebook.cells if cell.cell_type == "code")
    shown = [output for cell in notebook.cells for output in cell.get("outputs", [])]
    assert not any(output.output_type == "error" for output in shown)
    assert not re.search("/(home|root|tmp|Users)/", str(shown)) and str(NOTEBOOKS) not in str(shown)


@pytest.mark.parametrize("name", [*NAMES, *TOURS])
def test_notebooks_hold_no_logic(name: str) -> None:
    assert not any(word in text for text in code(read(name)) for word in ("def ", "if ", "while "))


def test_the_tables_are_shown(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    shown: list[str] = []
    monkeypatch.setattr(
        "IPython.display.display", lambda *tables: shown.extend(t._repr_markdown_() for t in tables)
    )
    monkeypatch.chdir(NOTEBOOKS)
    cells: dict[str, Any] = {}
    for text in code(read("tables")):
        exec(text, cells)
    assert [text.split(".")[0] for text in shown if text.startswith("Table")] == [
        "Table I",
        "Table II",
        "Table III",
        "Table IV",
    ]
    assert len(shown) == 7
    assert capsys.readouterr().out.count("\n") == len(REMARKS)


def test_the_figures_are_shown(monkeypatch: pytest.MonkeyPatch) -> None:
    # Several figures are of the same trials.
    monkeypatch.setattr("scripts.tables.figures.load_trials", cache(load_trials))
    cells: dict[str, Any] = {}
    figures, drawn = [], set[str]()
    first, *others = code(read("figures"))
    exec(first.replace("%matplotlib inline\n", ""), cells)
    cells["RESULTS"] = NOTEBOOKS / "results"
    for text in others:
        figures.append(eval(text, cells))
        assert all(ax.has_data() for ax in figures[-1].axes)
        kind = text.split("(")[0]
        if kind not in drawn:  # Of each kind the first, because layout takes most of the time.
            figures[-1].draw_without_rendering()
            drawn.add(kind)
    assert len(figures) == len(FIGURES)


def test_the_categories_are_drawn_by_name_with_their_own_objects_and_starts() -> None:
    figures: list[Figure] = []
    cells: dict[str, Any] = {"Figure": Figure}
    for text in code(read("categories")):
        exec(text.replace("%matplotlib inline\n", ""), cells)
        figures.append(cells.get("figure", Figure()))
    scenarios, overview, front = cells["scenarios"], figures[1], figures[2]
    assert tuple(scenarios) == category_names()
    titles = [ax.get_title() for ax in overview.axes]
    assert titles == [f"{name} {k}" for k in range(2) for name in scenarios]
    shown = [(ax, *ax.get_title().split()) for ax in overview.axes]
    shown += [(ax, ax.get_title(), "0") for ax in front.axes]
    for ax, name, environment in shown:
        instance = scenarios[name].sample_instance("evaluation", int(environment))
        discs = [patch for patch in ax.patches if isinstance(patch, Circle)]
        round_ones = sum(shape in ("cylinder", "sphere") for shape in instance.shape)
        assert len(discs) == round_ones + 1, "objects and the goal"
        marked = [line for line in ax.lines if line.get_gid() == "hand starts"]
        if instance.p_WA is not None and ax in overview.axes:  # In apertures of that environment.
            off = instance.p_WA[:, 1] - marked[0].get_ydata()[:, np.newaxis]
            assert np.abs(off).min(axis=1).max() < 1e-5
    assert sum(isinstance(patch, Circle) for patch in front.axes[0].patches) == 40 + 1


def wall_and_cpu_seconds() -> tuple[float, float]:
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.perf_counter(), usage.ru_utime + usage.ru_stime


@pytest.mark.slow
@pytest.mark.parametrize("name", TOURS)
def test_tours_run_in_less_than_a_minute_of_work(name: str) -> None:
    began = wall_and_cpu_seconds()
    notebook = run(name, NOTEBOOKS)
    wall, cpu = (b - a for a, b in zip(began, wall_and_cpu_seconds(), strict=True))
    # On a machine that is busy otherwise, waiting does not count.
    assert min(wall, cpu) < MAX_SECONDS
    assert len(list(outputs(notebook, "image/png"))) == PICTURES[name]
    frames = [text for text in outputs(notebook, "text/html") if "<iframe" in text]
    assert len(frames) == RECORDINGS[name]
    for text in frames:
        assert not re.search(r"(src|href)\s*=", text)


@pytest.mark.slow
@pytest.mark.browser
@pytest.mark.parametrize("name", ["one_reach", "pr2_selection"])
def test_a_notebook_s_recording_plays_in_a_browser(
    name: str, tmp_path: Path, chromium: str
) -> None:
    (frame,) = (text for text in outputs(run(name, NOTEBOOKS), "text/html") if "<iframe" in text)
    page = tmp_path / "output.html"
    page.write_text(f"<!DOCTYPE html><body>{frame}</body>", encoding="utf-8")
    image, console = visit(chromium, f"file://{page}", tmp_path)
    assert console == []
    # Of the goal behind a board only the pole is seen.
    assert_shows_a_scene(image[60:], 1e-5 if name == "pr2_selection" else 5e-5)
