import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from support.trial_rows import make_rows

from lic_drake.cli.main import main
from lic_drake.evaluate.reliability import FOLDER
from lic_drake.evaluate.trials import write_trials
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.paths import shipped_library
from lic_drake.select.registry import make_selector
from lic_drake.select.situation import FailedReach, Situation
from lic_drake.starts import make_starts

GOAL = ("--goal", "0.6", "0.1")
START = {"start_y": -0.1, "start_phi": 0.5235987755982988}
FINAL = {"final_x": 0.52, "final_y": -0.02}


def select(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, str, str]:
    code = main(["select", *arguments])
    out, err = capsys.readouterr()
    return code, out, err


def test_after_a_failure_the_command_answers_as_lic_2_does(
    library: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = [*GOAL, "--library", str(library), "--json"]
    code, out, _ = select(
        capsys, *arguments, "--method", "knn", "--failed", json.dumps(START | FINAL)
    )
    assert code == 0
    known = ExperienceLibrary(library)
    scenario, columns = known.scenario(), known.columns()
    selector = make_selector("knn", columns)
    starts = make_starts(scenario, scenario.sample_instance("evaluation", 0))
    row = np.flatnonzero(np.isclose(starts.grid.x0[:, 1:], list(START.values())).all(axis=1))
    begun = FailedReach.from_start(starts.grid[int(row[0])])
    failed = FailedReach(start=begun.start, shown={**begun.shown, **FINAL})
    asked = Situation(p_WG=np.array([0.6, 0.1, 0.0]), starts=starts, failed=(failed,))
    chosen = selector.select(asked)
    answer = json.loads(out)
    np.testing.assert_allclose(answer["start"], chosen.start.x0, atol=1e-9)
    assert answer["estimated_success"] == pytest.approx(chosen.probability)
    # It differs from the best start of LIC-1 away from the failure.
    code, out, _ = select(capsys, *arguments, "--method", "knn1", "--failed", str(START))
    assert code == 0
    assert json.loads(out)["estimated_success"] != pytest.approx(answer["estimated_success"])


def test_a_record_says_all_of_a_failure(
    library: Path, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    record = START | FINAL | {"outcome": "stuck", "start_x": 0.335, "base_y": 0.0, "after": []}
    path = tmp_path / "record.json"
    path.write_text(json.dumps(record))
    arguments = [*GOAL, "--library", str(library), "--method", "knn", "--json"]
    answers = [
        json.loads(select(capsys, *arguments, "--failed", failed)[1])["start"]
        for failed in (str(path), str(START | FINAL))
    ]
    assert answers[0] == answers[1]


@pytest.mark.parametrize(
    ("failed", "message"),
    [
        (str(START), "final_x, final_y is missing; add it to --failed; or use --method knn1"),
        ("{start_y: 0.1}", "but start_phi is missing; add it to --failed"),
        ("{colour: 3}", "'colour' is not a column of a record"),
        ("{start_y: [", "--failed: not YAML"),
        ("no.json", "--failed: cannot read 'no.json'"),
    ],
)
def test_what_lic_2_cannot_use_is_refused_and_never_dropped(
    failed: str, message: str, library: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = [*GOAL, "--library", str(library), "--method", "knn"]
    code, out, err = select(capsys, *arguments, "--failed", failed)
    assert code == 2 and out == ""
    assert message in err


def test_for_a_pr2_base_and_torso_of_the_failure_count(capsys: pytest.CaptureFixture[str]) -> None:
    library = ["--library", str(shipped_library("sphere-aperture-clutter"))]
    arguments = [*library, "--goal", "0.84", "-0.29", "0.79", "--method", "cost", "--json"]
    first = json.loads(select(capsys, *arguments)[1])
    _, y, z = first["start"][:3]
    where = {"start_y": y, "start_z": z}
    code, _, err = select(capsys, *arguments, "--failed", str(where))
    assert code == 2 and "base_y, torso is missing" in err
    where |= {"base_y": first["base"][1], "torso": first["torso"]}
    second = json.loads(select(capsys, *arguments, "--failed", str(where))[1])
    # Another aperture, or the same one from elsewhere.
    hand = np.subtract(second["start"][:3], first["start"][:3])
    stand = np.subtract([*second["base"], second["torso"]], [*first["base"], first["torso"]])
    assert max(np.linalg.norm(hand), np.linalg.norm(stand)) > 0.1


def test_where_choices_are_known_the_answer_has_a_probability_and_may_be_not_from_here(
    library: Path, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    copy = shutil.copytree(library, tmp_path / "copy")
    arguments = [*GOAL, "--library", str(copy), "--method", "knn", "--json"]
    code, out, err = select(capsys, *arguments, "--least", "0.2")
    assert code == 2 and out == "" and "has no 30 choices of knn for attempt 1" in err
    assert "probability" not in json.loads(select(capsys, *arguments)[1])
    write_trials(copy / FOLDER / "trials.parquet", make_rows("knn", ["1", "0", "0"] * 40))
    for least, worth in (("0.2", True), ("0.6", False)):
        answer = json.loads(select(capsys, *arguments, "--least", least)[1])
        assert answer["worth_trying"] is worth and answer["choices"] == 120
        low, high = answer["interval"]
        assert 0.2 < low < answer["probability"] < high < 0.6
    code, _, err = select(capsys, *arguments, "--least", "20")
    assert code == 2 and "--least must be from 0 to 1, got 20" in err
