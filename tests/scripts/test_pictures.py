"""What the READMEs' pictures show is what the commands show today."""

import json
import re
from pathlib import Path

import pytest

from scripts.pictures.run import DEMOS, IMAGES, NUMBERS, run_demo

ROOT = Path(__file__).resolve().parents[2]
SHOWN = json.loads((ROOT / IMAGES / NUMBERS).read_text(encoding="utf-8"))
OTHERS = {"diagram.png"}
"""Made by other scripts, see scripts/pictures/README.md."""


def outcomes(name: str) -> list[str]:
    return [attempt["outcome"] for attempt in SHOWN[name]["attempts"]]


@pytest.mark.usefixtures("_coarse")
def test_the_planar_demonstration_shows_what_its_pictures_show(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("lic_drake.show.pictures.save_rendered", lambda *args: {})
    assert run_demo("planar", tmp_path) == SHOWN["planar"]


@pytest.mark.slow
@pytest.mark.usefixtures("_renderer")
@pytest.mark.parametrize("name", ["pr2", "foliage", "iiwa14", "panda"])
def test_an_arm_in_space_shows_what_its_pictures_show(name: str, tmp_path: Path) -> None:
    assert run_demo(name, tmp_path) == SHOWN[name]


def test_every_picture_of_the_readmes_is_made_by_a_script() -> None:
    pages = [ROOT / "README.md", ROOT / "lic_drake/README.md", ROOT / "notebooks/results/README.md"]
    text = "\n".join(page.read_text(encoding="utf-8") for page in pages)
    used = set(re.findall(r"images/([\w.]+)", text))
    made = {picture for _, pictures in DEMOS.values() for picture in pictures}
    assert used == made | OTHERS
    assert used | {NUMBERS} == {path.name for path in (ROOT / IMAGES).iterdir()}
    assert {name: list(shown["pictures"]) for name, shown in SHOWN.items()} == {
        name: list(pictures) for name, (_, pictures) in DEMOS.items()
    }


def test_captions_tell_the_outcomes() -> None:
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    assert "reaches into foliage, gets stuck, starts elsewhere, and reaches](" in readme
    assert outcomes("foliage") == ["stuck", "reached"]
    assert "before and after a failure | the two attempts |" in readme
    assert outcomes("planar")[1:] == ["reached"] and outcomes("planar")[0] != "reached"
    for shown in SHOWN.values():
        assert shown["success"]
