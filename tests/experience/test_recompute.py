from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.fake_reach import fill_library, make_record

from lic_drake.cli.main import main
from lic_drake.errors import LibraryError
from lic_drake.experience.recompute import Difference, recompute
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.paths import shipped_library
from lic_drake.reach.request import ReachRecord, ReachRequest


@pytest.fixture
def library(tmp_path: Path) -> Path:
    return fill_library(tmp_path / "library")


def rng() -> np.random.Generator:
    return np.random.default_rng(3)


def test_every_row_is_drawn_once_and_the_same(library: Path) -> None:
    asked: list[str] = []

    def reach(request: ReachRequest) -> ReachRecord:
        asked.append(request.key)
        return make_record(request)

    done: list[int] = []
    assert recompute(ExperienceLibrary(library), 36, rng(), reach=reach, progress=done.append) == []
    assert sorted(asked) == sorted(ExperienceLibrary(library).keys())
    assert done == list(range(1, 37))


def test_a_difference_in_the_last_bit_is_told(library: Path) -> None:
    row = next(r for r in ExperienceLibrary(library).records() if r.outcome == "stuck")

    def reach(request: ReachRequest) -> ReachRecord:
        record = make_record(request)
        if request.key != row.key:
            return record
        final_x = np.nextafter(record.final_x, np.inf)
        return replace(record, outcome="timeout", final_x=float(final_x), wall_time_s=7.0)

    differing = recompute(ExperienceLibrary(library), 36, rng(), reach=reach)
    expected = Difference(key=row.key, fields=("outcome", "final_x"), outcomes=("stuck", "timeout"))
    assert differing == [expected]


def test_more_rows_than_there_are_cannot_be_drawn(library: Path) -> None:
    with pytest.raises(LibraryError, match="has 36 rows, fewer than 37"):
        recompute(ExperienceLibrary(library), 37, rng(), reach=make_record)


def test_rows_of_the_shipped_library_end_as_they_did() -> None:
    # Not bit for bit: that holds on the processor that collected it.
    library = ExperienceLibrary(shipped_library("cylinder-clutter"))
    differing = recompute(library, 25, rng())
    assert sum(row.outcomes[0] != row.outcomes[1] for row in differing) <= 1


def test_the_command_counts_and_names_differences(
    library: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    # The rows of this library were made up, so simulating them gives others.
    assert main(["experience", "recompute", str(library), "--rows", "2", "--seed", "1"]) == 1
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].endswith("of 2 rows are the same to the last bit")
    assert len(lines) >= 2
    assert main(["experience", "recompute", str(library), "--rows", "99"]) == 2
