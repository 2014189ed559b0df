"""What the registries accept and refuse."""

import dataclasses
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from lic_drake.clutter import registry as clutter
from lic_drake.clutter.instance import ClutterInstance
from lic_drake.clutter.registry import get_category, register_category
from lic_drake.errors import EstimateError, LicError, ScenarioError
from lic_drake.estimate import registry as estimate
from lic_drake.estimate.features import PLANAR_LIC1, features_of
from lic_drake.estimate.neighbours import NearestNeighbours
from lic_drake.estimate.registry import register_estimator
from lic_drake.paths import models_dir
from lic_drake.registry import Registry, load_extensions
from lic_drake.robots.planar import make_planar_arm, planar_arm
from lic_drake.robots.registry import get_robot, register_robot


def make_category(name: str = "Mine", **changes: object) -> type:
    def sample(self: object, rng: np.random.Generator) -> ClutterInstance:
        raise NotImplementedError

    members = {"sample": sample, "__annotations__": {"size_m": float}, "size_m": 0.1, **changes}
    return dataclasses.dataclass(kw_only=True)(type(name, (), members))


@pytest.fixture(autouse=True)
def _restore(monkeypatch: pytest.MonkeyPatch) -> None:
    for registry in (clutter._CATEGORIES, estimate._ESTIMATORS):
        monkeypatch.setattr(registry, "entries", dict(registry.entries))


@pytest.mark.parametrize("name", ["", "../up", 7])
def test_a_name_is_one_plain_word(name: object) -> None:
    with pytest.raises(LicError, match="name of a category"):
        Registry("category", LicError).register(name, object())


def test_a_cell_that_is_run_again_replaces_its_entry() -> None:
    for size_m in (0.1, 0.2):
        register_category("mine", make_category(size_m=size_m))
    assert get_category("mine").sampler().size_m == 0.2


def test_nobody_takes_anothers_name() -> None:
    register_category("mine", make_category())
    with pytest.raises(ScenarioError, match=r"'mine' is already registered.*choose another name"):
        register_category("mine", make_category("Yours"))
    with pytest.raises(ScenarioError, match="cylinder-clutter"):
        register_category("cylinder-clutter", make_category())
    with pytest.raises(ScenarioError, match="planar-arm"):
        register_robot("planar-arm", lambda: planar_arm())
    with pytest.raises(EstimateError, match="gp"):
        register_estimator("gp", lambda features: NearestNeighbours())
    assert get_robot("planar-arm") is planar_arm()


def test_a_name_of_an_estimator_means_one_method() -> None:
    register_estimator("mine", lambda features: NearestNeighbours())
    register_estimator("mine", lambda features: NearestNeighbours())
    register_estimator("other1", lambda features: NearestNeighbours())
    for name in ("rnd", "cost", "imagine", "gp1", "mine1", "other"):
        with pytest.raises(EstimateError, match=f"'{name}'.*choose another name"):
            register_estimator(name, lambda features: NearestNeighbours())


def test_entries_are_checked_when_they_are_registered() -> None:
    with pytest.raises(ScenarioError, match="dataclass"):
        register_category("mine", SimpleNamespace)
    with pytest.raises(ScenarioError, match="dataclass"):
        register_category("mine", make_category()())
    with pytest.raises(ScenarioError, match="sample"):
        register_category("mine", make_category(sample=None))
    with pytest.raises(ScenarioError, match=r"'size_m'.*__future__"):
        register_category("mine", make_category(__annotations__={"size_m": "float"}))

    @dataclasses.dataclass
    class NoDefault:
        size_m: float

        def sample(self, rng: np.random.Generator) -> ClutterInstance:
            raise NotImplementedError

    with pytest.raises(ScenarioError, match=r"'size_m'.*default"):
        register_category("mine", NoDefault)
    with pytest.raises(ScenarioError, match="function"):
        register_robot("mine", planar_arm())
    with pytest.raises(EstimateError, match="function"):
        register_estimator("mine", NearestNeighbours())


def test_features_are_registered_with_the_category() -> None:
    register_category("mine", make_category())
    assert features_of("mine").first == PLANAR_LIC1
    assert features_of("mine").second is not None
    register_category("mine", make_category(), in_space=True, observed=None)
    assert features_of("mine").second is None
    assert features_of("mine").first.in_space
    register_category("mine", make_category(), observed=("smell",))
    with pytest.raises(EstimateError, match=r"observed.*smell"):
        features_of("mine")


def described(*changes: tuple[str, str]) -> str:
    text = (models_dir() / "planar_arm.urdf").read_text(encoding="utf-8")
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    return text


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ([('<axis xyz="0 0 1"/>', '<axis xyz="0 0 -1"/>')], "closed form"),
        ([('<origin xyz="0 -0.334 0"/>', '<origin xyz="0.334 0 0"/>')], "closed form"),
        ([('type="revolute"', 'type="fixed"')], "0 revolute joints"),
        ([('lower="-2.61799387799" upper="2.61799387799" ', "")], "limits"),
        ([('<drake:capsule radius="0.015" length="0.334"/>', '<box size="1 1 1"/>')], "capsule"),
        ([("</robot>", "")], "planar arm"),
    ],
)
def test_a_description_of_another_kind_of_arm_is_refused(
    changes: list[tuple[str, str]], said: str
) -> None:
    with pytest.raises(ScenarioError, match=rf"model of mine(?s:.)*{said}") as caught:
        make_planar_arm("mine", described(*changes))
    assert "\n" not in str(caught.value)


def test_an_extension_that_cannot_be_imported_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    load_extensions.cache_clear()
    for name in ("no.such.module", ".relative"):
        monkeypatch.setenv("LIC_EXTENSIONS", name)
        with pytest.raises(LicError, match=f"'{name}'.*PYTHONPATH"):
            load_extensions()
    monkeypatch.undo()
    load_extensions.cache_clear()


def test_entry_points_of_installed_packages_are_imported(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.delenv("LIC_EXTENSIONS", raising=False)
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "theirs.py").write_text("import sys; sys.theirs_was_imported = True")
    installed = tmp_path / "theirs-1.0.dist-info"
    installed.mkdir()
    (installed / "METADATA").write_text("Metadata-Version: 2.1\nName: theirs\nVersion: 1.0\n")
    for value in ("theirs", "theirs:nothing"):
        (installed / "entry_points.txt").write_text(f"[lic_drake]\nshelves = {value}\n")
        load_extensions.cache_clear()
        if value == "theirs":
            load_extensions()
            assert sys.theirs_was_imported  # type: ignore[attr-defined]
        else:
            with pytest.raises(LicError, match=r"shelves = theirs:nothing .* cannot be imported"):
                load_extensions()
