import sys
from pathlib import Path

import numpy as np
import pytest

from lic_drake.estimate.categories import features_of
from lic_drake.estimate.features import FeatureMap
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.paths import shipped_library
from lic_drake.types import Vector
from scripts.ablation import space_features as ablate_space_features
from scripts.ablation.space_features import AGAIN, PLAIN, RELATIVE, hold_out_goals, second_table

FEATURES = features_of("sphere-aperture-clutter")


class Recalls:
    """Remembers which goals it was told, and likes starts near the goal."""

    def __init__(self, features: FeatureMap) -> None:
        self.goal, self.start = (
            [features.names.index(f"{thing}_{axis}") for axis in "yz"]
            for thing in ("goal", "start")
        )

    def fit(self, Z: Vector, f: Vector, environment: Vector) -> "Recalls":
        self.seen = {tuple(row) for row in np.round(Z[:, self.goal], 6)}
        return self

    def values(self, Z: Vector) -> Vector:
        assert not self.seen & {tuple(row) for row in np.round(Z[:, self.goal], 6)}
        return -np.linalg.norm(Z[:, self.start] - Z[:, self.goal], axis=1)


def test_goals_are_held_out_and_second_starts_are_other_ones(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def make(name: str, features: FeatureMap) -> Recalls:
        return Recalls(features)

    monkeypatch.setattr(ablate_space_features, "FIRSTS", {PLAIN: make, RELATIVE: make})
    monkeypatch.setattr(ablate_space_features, "SECONDS", {"same": make})
    monkeypatch.setattr(ablate_space_features, "_gap", lambda *_: np.nan)
    columns = ExperienceLibrary(shipped_library("sphere-aperture-clutter")).columns()
    few = {key: values[columns["environment"] < 8] for key, values in columns.items()}
    found = hold_out_goals("gp", FEATURES, few)
    failures = found.won[RELATIVE].count(False)
    assert len(found.won[RELATIVE]) == 8 * 12
    assert found.won[PLAIN] == found.won[RELATIVE]
    # An estimate that knows nothing of the failure chooses as LIC-1, and would repeat itself.
    assert found.second["same"] == found.second[AGAIN]
    assert found.repeated["same"] == failures == len(found.random)
    assert sum(found.random) < sum(found.second[AGAIN]) <= sum(found.second["possible"])
    assert f"| {sum(found.second[AGAIN])}/{failures} |" in second_table({"gp": found}).to_markdown()


@pytest.mark.parametrize(
    ("library", "message"),
    [
        (Path("none"), "error: no experience library at"),
        (shipped_library("passage-clutter"), "error: features of passage-clutter cannot be"),
    ],
)
def test_other_libraries_are_refused(
    library: Path,
    message: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    out = tmp_path / "out.md"
    arguments = ["ablate_space_features.py", "--library", str(library), "--out", str(out)]
    monkeypatch.setattr(sys, "argv", arguments)
    assert ablate_space_features.main() == 2
    assert capsys.readouterr().err.startswith(message)
    assert not out.exists()
