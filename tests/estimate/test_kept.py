"""Fits that are kept give what fits give, and what cannot be trusted is fitted again."""

import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.fake_reach import fill_library
from support.starts import LINE

from lic_drake.estimate import gaussian_process
from lic_drake.estimate.estimator import from_sklearn
from lic_drake.estimate.registry import register_estimator
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.kept import VARIABLE, cache_folder
from lic_drake.select.lic import LicSelector
from lic_drake.select.registry import make_selector
from lic_drake.select.situation import FailedReach, Situation

GOAL = np.array([0.6, 0.1, 0.0])


@pytest.fixture(scope="module")
def columns(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    return ExperienceLibrary(fill_library(tmp_path_factory.mktemp("library"))).columns()


@pytest.fixture
def kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv(VARIABLE, str(tmp_path / "kept"))
    return tmp_path / "kept"


def make(method: str, columns: dict[str, Any]) -> tuple[LicSelector, list[str]]:
    said: list[str] = []
    selector = make_selector(method, columns, say=said.append)
    assert isinstance(selector, LicSelector)
    return selector, said


def answers(selector: LicSelector) -> list[Any]:
    """Starts and estimates at a first and a second attempt, and estimates all over the grid."""
    shown = dict.fromkeys(("final_x", "final_y"), 0.5)
    begun = FailedReach.from_start(LINE.grid[5])
    failed = FailedReach(start=begun.start, shown={**begun.shown, **shown})
    found: list[Any] = []
    for before in ((), (failed,)):
        situation = Situation(p_WG=GOAL, starts=LINE, failed=before)
        chosen = selector.select(situation)
        found += [chosen.start.x0.tolist(), chosen.start.b0.tolist(), chosen.probability]
        found += [selector.objective(situation).values(LINE.grid).tolist()]
    return found


@pytest.mark.parametrize("method", ["gp", "knn"])
@pytest.mark.parametrize("source", ["simulation", "lab"])
def test_a_kept_fit_selects_the_same_bit_for_bit(
    method: str, source: str, columns: dict[str, Any], kept: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    mixed = dict(columns) | {"source": columns["source"].copy(), "weight": columns["weight"].copy()}
    mixed["source"][::3], mixed["weight"][::3] = source, 4.0
    first, said = make(method, mixed)
    assert said[2] == f"fitting {method} on 36 reaches of cylinder-clutter ..."
    assert [line.split(" in ")[0] for line in said[1::2]] == 2 * [f"fitted {method}"]
    assert " pairs of reaches of cylinder-clutter ..." in said[0]
    assert len(list(kept.iterdir())) == 2
    second, said = make(method, mixed)
    assert said == []
    monkeypatch.setenv(VARIABLE, "off")
    without, said = make(method, mixed)
    assert len(said) == 4
    assert answers(first) == answers(second) == answers(without)


def test_a_kept_process_solves_nothing_and_forgets_the_solution_with_other_rows(
    columns: dict[str, Any], kept: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first, _ = make("gp1", columns)
    (path,) = kept.iterdir()

    def refuse(*args: object) -> None:
        raise AssertionError("solved again")

    with monkeypatch.context() as patched:
        patched.setattr(gaussian_process, "_solve", refuse)
        second, said = make("gp1", columns)
    assert said == [] and answers(first) == answers(second)
    X, y = np.random.default_rng(0).uniform(0.0, 0.5, (6, 4)), np.array([0.0, 1.0] * 3)
    other, again = (
        selector.first.estimator.conditioned_on(X, y).values(X) for selector in (first, second)
    )
    np.testing.assert_array_equal(other, again)
    assert not np.array_equal(other, first.first.estimator.values(X))
    for solution in (np.ones(3), np.ones((2, 2)), np.full(7, np.nan)):
        with np.load(path) as file:
            arrays = dict(file)
        np.savez(path, **(arrays | {"solution_": solution}))
        assert answers(make("gp1", columns)[0]) == answers(first)


def test_other_rows_are_fitted_anew(columns: dict[str, Any], kept: Path) -> None:
    make("knn1", columns)
    other = columns | {"success": ~columns["success"]}
    assert make("knn1", other)[1] != []
    assert make("knn1", {name: x[:-1] for name, x in columns.items()})[1] != []
    assert make("knn1", columns)[1] == make("knn1", other)[1] == []


def one_bit_flipped(path: Path) -> None:
    with np.load(path) as file:
        number = file["bandwidth"][2].tobytes()
    content = path.read_bytes()
    assert content.count(number) == 1
    path.write_bytes(content.replace(number, bytes([number[0] ^ 1]) + number[1:]))


def swapped(path: Path) -> None:
    other = path.with_name("other.npz")
    path.rename(other)
    np.savez(path, kept_as=np.array("other.npz"), bandwidth=np.ones(4))


@pytest.mark.parametrize(
    "damage",
    [
        lambda path: path.write_bytes(path.read_bytes()[:-40]),
        one_bit_flipped,
        lambda path: path.write_bytes(b"not numbers"),
        lambda path: path.write_bytes(b""),
        lambda path: path.write_bytes(pickle.dumps(np.ones(4))),
        lambda path: np.savez(path, kept_as=path.name, bandwidth=np.array([print], dtype=object)),
        lambda path: np.savez(path, kept_as=path.name, bandwidth=np.array([1.0, np.nan, 1.0, 1.0])),
        lambda path: np.savez(path, kept_as=path.name, bandwidth=np.ones(3)),
        lambda path: np.savez(path, kept_as=path.name, width=np.ones(4)),
        lambda path: np.savez(path, kept_as=path.name),
        swapped,
    ],
)
def test_a_damaged_or_foreign_file_is_said_and_not_trusted(
    damage: Callable[[Path], None], columns: dict[str, Any], kept: Path
) -> None:
    before, _ = make("knn1", columns)
    (path,) = kept.iterdir()
    damage(path)
    after, said = make("knn1", columns)
    assert len(said) == 3 and said[0].startswith(f"lic: ignored the kept fit {path}: ")
    assert "\n" not in said[0]
    X = np.random.default_rng(0).uniform(0.0, 0.5, (20, 4))
    np.testing.assert_array_equal(after.first.estimator.values(X), before.first.estimator.values(X))
    assert make("knn1", columns)[1] == []  # It was replaced.


@pytest.mark.usefixtures("registries_restored")
def test_what_others_registered_is_fitted_every_time(columns: dict[str, Any], kept: Path) -> None:
    from sklearn.linear_model import LogisticRegression

    register_estimator("mine", lambda features: from_sklearn(LogisticRegression()))
    for _ in range(2):
        assert len(make("mine1", columns)[1]) == 2
    assert not kept.exists()


def test_a_folder_that_cannot_be_written_costs_a_line(columns: dict[str, Any], kept: Path) -> None:
    kept.write_text("a file")
    assert make("knn1", columns)[1][-1].startswith(f"lic: cannot keep the fit in {kept}: ")


def test_the_folder_is_the_user_s_cache_unless_told_otherwise(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.delenv(VARIABLE)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert cache_folder() == tmp_path / "lic_drake"
    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.setenv("HOME", str(tmp_path))
    assert cache_folder() == tmp_path / ".cache" / "lic_drake"
    monkeypatch.setenv(VARIABLE, "off")
    assert cache_folder() is None
