from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.fake_reach import make_record, make_request

from lic_drake.errors import LibraryError
from lic_drake.experience.real_pairs import pair_real_attempts
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.reach.request import ReachRequest, flat_starts
from lic_drake.reach.start import Start


def _columns(path: Path, requests: list[ReachRequest]) -> dict[str, np.ndarray]:
    library = ExperienceLibrary(path)
    library.write_shard(
        "attempts",
        [
            replace(
                make_record(r),
                base_x=r.start.b0[0],
                base_y=r.start.b0[1],
                after=flat_starts(r.after),
            )
            for r in requests
        ],
        requests[0].scenario,
    )
    return library.columns()


def test_each_second_attempt_stands_beside_the_first_one_that_it_came_after(
    tmp_path: Path,
) -> None:
    requests = make_request().reaches(0)
    firsts, others = requests[:2], requests[2:5]
    seconds = [f.then(Start(o.start.x0, np.array([0.0, 0.2, 0.0]))) for f in firsts for o in others]
    columns = _columns(tmp_path, [*firsts, *seconds])
    pairs = pair_real_attempts(columns)
    assert pairs["key"].tolist() == [second.key for second in seconds]
    np.testing.assert_array_equal(pairs["first_start_y"], [s.after[0].x0[1] for s in seconds])
    finals = {request.key: make_record(request).final_x for request in firsts}
    expected = [finals[firsts[i // len(others)].key] for i in range(len(seconds))]
    np.testing.assert_array_equal(pairs["first_final_x"], expected)
    np.testing.assert_array_equal(pairs["base_y"], 0.2)


def test_third_attempts_are_left_out(tmp_path: Path) -> None:
    first, other, *_ = make_request().reaches(0)
    second = first.then(other.start)
    third = second.then(first.start)
    pairs = pair_real_attempts(_columns(tmp_path, [first, second, third]))
    assert pairs["key"].tolist() == [second.key]


def test_libraries_without_pairs_are_refused(tmp_path: Path) -> None:
    first, other, *_ = make_request().reaches(0)
    with pytest.raises(LibraryError, match="holds no second attempts"):
        pair_real_attempts(_columns(tmp_path / "firsts", [first, other]))
    second = first.then(other.start)
    with pytest.raises(LibraryError, match="lacks the first attempt"):
        pair_real_attempts(_columns(tmp_path / "seconds", [second, other]))
