"""The lesson: the notebooks run, and what they show is right and is what is stored in them."""

import ast
import base64
import io
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import matplotlib as mpl
import nbformat
import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.collections import QuadMesh
from matplotlib.colors import same_color
from matplotlib.figure import Figure
from matplotlib.image import imread
from matplotlib.lines import Line2D
from matplotlib.patches import Circle
from support.browser import assert_shows_a_scene, visit

import lic_drake as lic
from lic_drake.evaluate.paper import REMARKS
from lic_drake.show.recording import Recording
from scripts.tables.figures import FIGURES

NOTEBOOKS = Path(__file__).resolve().parent.parent / "notebooks"
NAMES = sorted(path.stem for path in NOTEBOOKS.glob("*.ipynb"))
MAX_NOTEBOOK_BYTES = 200_000


def read(name: str) -> nbformat.NotebookNode:
    return nbformat.read(NOTEBOOKS / f"{name}.ipynb", as_version=4)


def code(name: str) -> list[str]:
    return [cell.source for cell in read(name).cells if cell.cell_type == "code"]


def stored(name: str) -> Iterator[np.ndarray]:
    """Yields the pictures that are stored in a notebook, shape (height, width, 3), 0 to 1."""
    for cell in read(name).cells:
        for output in cell.get("outputs", []):
            if png := output.get("data", {}).get("image/png"):
                yield imread(io.BytesIO(base64.b64decode(png)))[:, :, :3]


def test_the_lesson_is_numbered_and_its_table_of_contents_is_complete() -> None:
    assert [name.split("_")[0] for name in NAMES] == [str(k + 1) for k in range(len(NAMES))]
    contents = (NOTEBOOKS / "README.md").read_text(encoding="utf-8")
    assert re.findall(r"\((\w+)\.ipynb\)", contents) == NAMES


@pytest.mark.parametrize("name", NAMES)
def test_a_notebook_says_what_one_learns_and_ends_with_something_to_try(name: str) -> None:
    first, *_, last = read(name).cells
    assert first.source.startswith(f"# {name[0]}. ")
    assert first.source.partition("\n\n")[2].startswith("You will ")
    assert re.search(r"\*\*Try:\*\* .*\?", last.source, re.DOTALL)


@pytest.mark.parametrize("name", NAMES)
def test_outputs_are_stored_small_without_errors_and_name_no_machine(name: str) -> None:
    assert (NOTEBOOKS / f"{name}.ipynb").stat().st_size < MAX_NOTEBOOK_BYTES
    cells = [cell for cell in read(name).cells if cell.cell_type == "code"]
    assert all(cell.execution_count for cell in cells)
    shown = [output for cell in cells for output in cell.outputs]
    assert not any(output.output_type == "error" for output in shown)
    assert not re.search("/(home|root|tmp|Users)/", str(shown)) and str(NOTEBOOKS) not in str(shown)


@pytest.mark.parametrize("name", NAMES)
def test_notebooks_hold_no_logic_and_need_only_public_names(name: str) -> None:
    text = "\n".join(code(name))
    assert not any(word in text for word in ("def ", "if ", "while "))
    assert not re.search(r"from lic_drake|import lic_drake\.", text)


@pytest.mark.parametrize("name", NAMES)
def test_links_of_a_notebook_lead_somewhere(name: str) -> None:
    for cell in read(name).cells:
        for link in re.findall(
            r"\]\(([^)#]+)", cell.source if cell.cell_type == "markdown" else ""
        ):
            assert (NOTEBOOKS / link).exists(), link


@pytest.mark.parametrize("name", ["7_the_pr2_and_other_arms", "8_extend"])
def test_files_that_are_shown_are_stored_as_they_are(name: str) -> None:
    checkout = NOTEBOOKS.parent
    files = [*(NOTEBOOKS / "extend").iterdir(), checkout / "models" / "robots" / "panda.yaml"]
    files.append(checkout / "scripts" / "examples" / "own_controller.py")
    texts = {path.read_text(encoding="utf-8") for path in files if path.is_file()}
    shown = [output for cell in read(name).cells for output in cell.get("outputs", [])]
    markdown = [output.get("data", {}).get("text/markdown", "") for output in shown]
    blocks = re.findall(r"^```\w+\n(.*?)```$", "\n".join(markdown), re.DOTALL | re.MULTILINE)
    assert blocks and set(blocks) <= texts


class Lesson:
    """A notebook that was run in this process.

    `cells` has its variables, `figures` and `recordings` what it shows, in their order.
    """

    def __init__(self, name: str) -> None:
        self.cells: dict[str, Any] = {}
        shown: list[Any] = []
        for text in code(name):
            *body, last = ast.parse(text.replace("%matplotlib inline\n", "")).body
            body += [] if isinstance(last, ast.Expr) else [last]
            exec(compile(ast.Module(body, []), name, "exec"), self.cells)
            if isinstance(last, ast.Expr):
                shown.append(eval(compile(ast.Expression(last.value), name, "eval"), self.cells))
        self.figures = [value for value in shown if isinstance(value, Figure)]
        self.recordings = [value for value in shown if isinstance(value, Recording)]
        assert_same_pictures(name, self.figures)

    def __getitem__(self, variable: str) -> Any:
        return self.cells[variable]


def assert_same_pictures(name: str, figures: list[Figure]) -> None:
    """Sees that what is stored is what a run shows, but for rounding on other machines."""
    for picture, figure in zip(stored(name), figures, strict=True):
        buffer = io.BytesIO()
        figure.savefig(buffer, dpi=figure.dpi, bbox_inches="tight")
        buffer.seek(0)
        drawn = imread(buffer)[:, :, :3]
        assert np.abs(np.subtract(picture.shape, drawn.shape)).max() <= 3
        height, width = np.minimum(picture.shape, drawn.shape)[:2]
        difference = np.abs(picture[:height, :width] - drawn[:height, :width])
        assert difference.mean() < 0.03
        assert picture.std() > 0.05


@pytest.fixture
def learn(monkeypatch: pytest.MonkeyPatch, registries_restored: None) -> Iterator[type[Lesson]]:
    """Runs a notebook where it lies, and forgets what it changes."""
    monkeypatch.chdir(NOTEBOOKS)
    monkeypatch.syspath_prepend(NOTEBOOKS)
    with mpl.rc_context():
        yield Lesson


def line(ax: Axes, index: int = 0) -> np.ndarray:
    """Points of a line, shape (n, 2)."""
    return np.asarray(ax.lines[index].get_xydata())


def tip_path(ax: Axes) -> np.ndarray:
    """The path of the tip in a view: the one line with a label; shape (n, 2)."""
    (found,) = (x for x in ax.lines if not str(x.get_label()).startswith("_"))
    return np.asarray(found.get_xydata())


def assert_ends_as_it_says(ax: Axes, p_WG: np.ndarray) -> None:
    """Sees in a view whether the tip came to the goal, and that the legend says so."""
    (text,) = ax.get_legend_handles_labels()[1]
    assert (np.linalg.norm(tip_path(ax)[-1] - p_WG[:2]) < 0.03) == (text == "reached")


def assert_is_a_map_of(ax: Axes, start: Any, estimate: float) -> None:
    """Sees that a map of estimates is one of probabilities, with the chosen start on its top."""
    (mesh,) = (x for x in ax.collections if isinstance(x, QuadMesh))
    assert mesh.get_clim() == (0.0, 1.0)
    values = np.ma.masked_invalid(mesh.get_array())
    assert 0.0 <= values.min() < values.max() <= estimate + 1e-3
    star = next(x for x in ax.lines if isinstance(x, Line2D) and x.get_marker() == "*")
    np.testing.assert_allclose(star.get_xydata(), [start.x0_R[1:]])


@pytest.mark.slow
def test_1_categories_have_their_own_objects_and_starts_and_starts_decide(learn) -> None:
    lesson = learn("1_the_problem")
    scenarios, (overview, front, decide) = lesson["scenarios"], lesson.figures
    assert tuple(scenarios) == lic.category_names()
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
    # Starts differ in nothing but themselves, and some succeed.
    assert len(lesson["records"]) == 21
    assert 0 < lesson["records"]["success"].sum() < 21
    for ax in decide.axes:
        assert_ends_as_it_says(ax, lesson["goal"])
    outcomes = [ax.get_legend_handles_labels()[1][0] for ax in decide.axes]
    assert outcomes[0] != outcomes[1] == "reached"


def test_2_forces_and_distances_are_those_of_the_record(learn) -> None:
    lesson = learn("2_one_reach")
    snapshots, felt = lesson.figures
    record, trace = lesson["record"], lesson["trace"]
    times = [float(ax.get_title().split()[0]) for ax in snapshots.axes]
    assert times == sorted(times) and times[0] == 0.0
    assert times[-1] == pytest.approx(record.duration_s, abs=0.1)
    left, middle, right, _ = felt.axes
    assert line(left)[:, 1].min() == pytest.approx(record.min_distance)
    assert line(middle)[:, 1].max() == pytest.approx(record.peak_force) and record.peak_force > 5.0
    assert line(middle, 1)[:, 1] == pytest.approx([5.0, 5.0])
    (dots,) = right.collections
    assert len(dots.get_offsets()) == sum(trace.contacts) > 100
    assert dots.get_array().max() == pytest.approx(record.peak_force)


def test_3_the_maps_are_rates_of_the_library(learn) -> None:
    lesson = learn("3_a_library")
    (figure,) = lesson.figures
    columns = lic.ExperienceLibrary(lic.shipped_library("cylinder-clutter")).columns()
    for ax, (along, up) in zip(
        figure.axes, (("goal_x", "goal_y"), ("start_y", "start_phi")), strict=False
    ):
        (mesh,) = ax.collections
        assert mesh.get_clim() == (0.0, 1.0)
        x, y = np.unique(columns[along].round(6)), np.unique(columns[up].round(6))
        rates = np.reshape(mesh.get_array(), (len(y), len(x)))
        for i, j in ((0, 1), (2, 3), (len(y) - 1, len(x) - 1)):
            here = np.isclose(columns[along], x[j]) & np.isclose(columns[up], y[i])
            if np.any(here):
                assert rates[i, j] == pytest.approx(columns["success"][here].mean())
    assert lesson["by_environment"]["count"].sum() == len(columns["success"])


@pytest.mark.slow
def test_4_the_maps_are_of_probabilities_and_calibration_counts_all_reaches(learn) -> None:
    lesson = learn("4_what_an_estimator_believes")
    *maps, calibration = lesson.figures
    for figure, selector in zip(maps, (lesson["gp"], lesson["knn"]), strict=True):
        situation = lic.Situation(p_WG=lesson["goal"], starts=lesson["starts"])
        best = selector.select(situation)
        assert_is_a_map_of(figure.axes[0], best.start, best.probability)
    right, unseen = lesson["right"], lesson["unseen"]
    assert set(unseen["environment"]) == set(range(8, 20))
    for ours, whole in (("estimated", "estimate"), ("succeeded", "success")):
        # Estimates of exactly 0 are in no tenth.
        inside = unseen[unseen["estimate"] > 0.0]
        mean = np.average(right[ours], weights=right["reaches"])
        assert mean == pytest.approx(inside[whole].mean())
    assert right["succeeded"].is_monotonic_increasing
    _, all_starts, chosen = calibration.axes[0].lines
    np.testing.assert_array_equal(all_starts.get_ydata(), right["succeeded"])
    np.testing.assert_array_equal(chosen.get_ydata(), lesson["choices"]["succeeded"])


@pytest.mark.slow
def test_5_the_constraint_binds_and_is_drawn_where_it_is(learn) -> None:
    lesson = learn("5_choosing")
    free, bound, limit = lesson["free"], lesson["bound"], lesson["LIMIT_M"]
    assert free.start.b0[1] > limit >= bound.start.b0[1] - 1e-6
    assert free.probability > bound.probability
    begin, end = lesson["values"].max(), lesson["program"].values(lic.Starts.of(lesson["end"]))[0]
    assert begin < end <= free.probability + 1e-9
    (figure,) = lesson.figures
    for ax, selection in zip(figure.axes, (free, bound), strict=True):
        assert_ends_as_it_says(ax, lesson["goal"])
        np.testing.assert_allclose(tip_path(ax)[0], selection.start.x0[:2], atol=1e-3)
    red = figure.axes[1].lines[-1]
    assert same_color(red.get_color(), "tab:red") and min(red.get_ydata()) == limit


@pytest.mark.slow
def test_6_the_first_attempt_fails_and_the_second_one_reaches(learn) -> None:
    lesson = learn("6_a_second_try")
    attempts = lesson["attempts"]
    assert [attempt.record.success for attempt in attempts] == [False, True]
    maps, snapshots = lesson.figures
    for ax, attempt in zip(maps.axes, attempts, strict=False):
        assert_is_a_map_of(ax, attempt.selection.start, attempt.selection.probability)
    first, second = (ax.collections[0].get_array() for ax in maps.axes[:2])
    assert np.nanmax(np.abs(first - second)) > 0.05, "another function"
    ends = [ax.get_title().split(", ")[-1] for ax in snapshots.axes[3::4]]
    assert ends == [attempt.record.outcome for attempt in attempts]


@pytest.mark.slow
def test_7_the_map_frames_the_chosen_aperture_and_all_arms_pass_the_check(learn) -> None:
    lesson = learn("7_the_pr2_and_other_arms")
    aperture_map, reach = lesson.figures
    (ax,) = aperture_map.axes
    *apertures, frame, goal = ax.patches
    assert len(apertures) == len(lesson["starts"].p_WA)
    centre = frame.get_xy()[:4].mean(axis=0)
    np.testing.assert_allclose(centre, lesson["start"].x0[1:3], atol=0.02)
    np.testing.assert_allclose(goal.center, lesson["goal"][1:])
    # Written is the best of a grid; the selection is at least as good.
    written = [float(text.get_text()) for text in ax.texts]
    assert 0.0 <= min(written) < max(written) <= lesson["selection"].probability + 0.005
    left, right = reach.axes
    assert (line(left)[-1, 1] < 0.03) == (left.get_title() == "reached")
    assert line(right)[:, 1].max() == pytest.approx(max(lesson["trace"].peak_force))
    checks = lesson["checks"]
    assert set(checks) == {"pr2", "iiwa14", "panda"}
    assert all(check["reaches"] and check["settles"] for check in checks.values())


@pytest.mark.slow
def test_8_all_extensions_work_together(learn, capsys: pytest.CaptureFixture[str]) -> None:
    lesson = learn("8_extend")
    assert 0 < lesson["columns"]["success"].sum() < len(lesson["columns"]["success"])
    (figure,) = lesson.figures
    assert [ax.get_title() for ax in figure.axes] == ["cost", "gp", "boosting"]
    for ax in figure.axes:
        assert_ends_as_it_says(ax, lesson["goal"])
    assert [line.split(":")[0] for line in capsys.readouterr().out.splitlines()[-2:]] == [
        "MPC",
        "Yielding",
    ]


def test_9_tables_and_figures_are_those_of_the_records(
    learn, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    shown: list[str] = []
    monkeypatch.setattr(
        "IPython.display.display", lambda *tables: shown.extend(t._repr_markdown_() for t in tables)
    )
    lesson = learn("9_the_results")
    captions = [text.split(".")[0] for text in shown if text.startswith("Table")]
    assert captions == [f"Table {number}" for number in ("I", "II", "III", "IV")]
    assert len(shown) == 7
    assert capsys.readouterr().out.count("\n") == len(REMARKS)
    kinds = {name.partition("_")[0] for name in FIGURES}
    used = re.findall(r'FIGURES\["([a-z]+)_', "\n".join(code("9_the_results")))
    # Maps of goals, which are large, are among the files.
    assert set(used) == kinds - {"goals"} and len(used) == len(lesson.figures)
    assert all(ax.has_data() for figure in lesson.figures for ax in figure.axes)
    # The totals of the tables are bars, ours and the paper's.
    bars = [figure for figure in lesson.figures if "hatched" in figure.axes[0].get_title()]
    for figure, key in zip(bars, ("table_1", "table_3", "table_4"), strict=True):
        heights = [f"{bar.get_height():.2f}" for bar in figure.axes[0].patches]
        totals = [row for row in lesson["tables"][key][0].rows if row and row[0] == "total"]
        assert len(totals) == 4
        for _, _, ours, _, paper, *_ in totals:
            assert ours.split()[0] in heights
            assert paper == "-" or paper.split()[0] in heights


@pytest.mark.slow
@pytest.mark.browser
@pytest.mark.parametrize("name", ["2_one_reach", "6_a_second_try", "7_the_pr2_and_other_arms"])
def test_a_notebook_s_recording_shows_a_scene(
    name: str, learn, tmp_path: Path, chromium: str
) -> None:
    (recording,) = learn(name).recordings
    frame = recording._repr_html_()
    assert not re.search(r"(src|href)\s*=", frame), "needs a network"
    page = tmp_path / "output.html"
    page.write_text(f"<!DOCTYPE html><body>{frame}</body>", encoding="utf-8")
    image, console = visit(chromium, f"file://{page}", tmp_path)
    assert console == []
    # Of a goal behind clutter or a board only the pole is seen.
    assert_shows_a_scene(image[60:], 1e-5)
