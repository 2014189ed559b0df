from pathlib import Path

import numpy as np
import pytest
import yaml
from support.fake_reach import make_request

from lic_drake.errors import LicError, RequestError
from lic_drake.experience.collect import CollectionRequest, read_request, write_request
from lic_drake.reach.scenario import load_scenario

SCENARIO = load_scenario("cylinder-clutter")


def test_the_papers_library_has_18900_different_reaches() -> None:
    request = CollectionRequest(scenario=SCENARIO)
    assert (len(request.goals()), len(request.starts().x0)) == (45, 21)
    assert len(request.environment_indices) * len(request.reaches(0)) == 18_900
    assert len({item.key for e in (0, 19) for item in request.reaches(e)}) == 2 * 945


def test_the_papers_library_of_passages_has_1680_different_reaches() -> None:
    scenario = load_scenario("passage-clutter")
    request = CollectionRequest(scenario=scenario, environments=120)
    assert (len(request.goals()), len(request.starts().x0)) == (1, 14)
    reaches = list(request.all_reaches())
    assert len({item.key for item in reaches}) == len(reaches) == 1680
    # Each environment has a goal of its own, the one that trials there ask for.
    goals = {(item.environment, tuple(item.goal)) for item in reaches}
    assert len({goal for _, goal in goals}) == len(goals) == 120
    for environment, goal in goals:
        assert goal == tuple(scenario.sample_goal("training", environment).tolist())


def test_the_papers_library_of_apertures_has_7200_different_reaches() -> None:
    scenario = load_scenario("cylinder-aperture-clutter")
    request = CollectionRequest(scenario=scenario, environments=480)
    assert request.num_reaches() == 7200
    reaches = list(request.all_reaches("1/40"))
    assert len({item.key for item in reaches}) == len(reaches) == 12 * 15
    # The base differs in every reach.
    assert len({tuple(item.start.b0) for item in reaches}) == len(reaches)
    apertures = scenario.sample_instance("training", 0).p_WA
    assert apertures is not None
    starts = {tuple(item.start.x0[:2]) for item in reaches if item.environment == 0}
    assert starts == set(map(tuple, apertures[:, :2].tolist()))


def test_every_goal_is_tried_from_every_start() -> None:
    request = make_request(first_environment=5, stream="holdout")
    reaches = request.reaches(6)
    pairs = {(tuple(item.goal), item.start) for item in reaches}
    assert len(reaches) == len(pairs) == 4 * 3
    assert {tuple(item.goal) for item in reaches} == set(map(tuple, request.goals().tolist()))
    assert {(item.stream, item.environment) for item in reaches} == {("holdout", 6)}
    assert list(request.environment_indices) == [5, 6, 7]


@pytest.mark.parametrize(("max_goals", "max_starts"), [(1, 60), (7, 4), (44, 20)])
def test_subsampling_is_even_and_keeps_the_order(max_goals: int, max_starts: int) -> None:
    request = make_request(max_goals=max_goals, max_starts=max_starts)
    for thinned, grid in (
        (request.goals(), SCENARIO.task.goal_area.grid()),
        (request.starts().x0, SCENARIO.task.start_line.grid(SCENARIO.arm())),
    ):
        count = min(max_goals if len(grid) == 45 else max_starts, len(grid))
        rows = [np.flatnonzero((grid == row).all(axis=1))[0] for row in thinned]
        gaps = np.diff([-1, *rows, len(grid)])
        assert len(rows) == count
        assert np.all(gaps[1:-1] >= len(grid) // count)
        assert np.all(gaps[1:-1] <= -(-len(grid) // count))
        assert abs(gaps[0] - gaps[-1]) <= 1


def test_a_share_is_every_nth_environment() -> None:
    request = make_request(first_environment=5, environments=7)
    shares = [list(request.environments_of(f"{k}/3")) for k in (1, 2, 3)]
    assert shares == [[5, 8, 11], [6, 9], [7, 10]]
    for share in ("0/3", "4/3", "1", "a/b", "-1/3"):
        with pytest.raises(RequestError, match=f"with k from 1 to n, for .*, got {share}"):
            request.environments_of(share)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"environments": "many"}, "environments must be from 1 to 1000000, got many"),
        ({"max_goals": 0}, "max_goals must be from 1 to .*, got 0"),
        ({"stream": "tuning"}, "unknown stream 'tuning'; choose one of"),
        ({"surprise": 1}, "is not a collection request"),
        ({"scenario_digest": "0" * 12}, "edited or written by another lic_drake"),
    ],
)
def test_an_edited_request_file_is_rejected(
    tmp_path: Path, values: dict[str, object], message: str
) -> None:
    path = tmp_path / "request.yaml"
    write_request(make_request(), path)
    path.write_text(yaml.safe_dump({**yaml.safe_load(path.read_text()), **values}))
    with pytest.raises(LicError, match=message):
        read_request(path)


def test_an_unreachable_start_line_is_rejected() -> None:
    scenario = load_scenario("cylinder-clutter", "{task: {start_line: {x_m: 3.0}}}")
    with pytest.raises(RequestError, match="planar-arm can reach no pose of the start line"):
        make_request(scenario=scenario).starts()
