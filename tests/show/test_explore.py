import time
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from pydrake.geometry import Meshcat
from support.made_up import planar_library, sphere_library

from lic_drake.errors import RequestError
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.reach.scenario import Scenario, load_scenario
from lic_drake.select.lic import LicSelector
from lic_drake.select.registry import make_selector
from lic_drake.select.situation import FailedReach, Situation
from lic_drake.show import explore
from lic_drake.show.density import map_success, mark_starts
from lic_drake.show.explore import AGAIN, ENVIRONMENT, ESTIMATE, REACH, Explorer
from lic_drake.show.stage import open_meshcat
from lic_drake.starts import make_starts

GOAL_Y = "goal y [m]"


def learn(library: ExperienceLibrary) -> tuple[Scenario, LicSelector]:
    scenario = library.scenario()
    selector = make_selector("knn", library.columns())
    assert isinstance(selector, LicSelector)
    return scenario, selector


@pytest.fixture(scope="module")
def plane(tmp_path_factory: pytest.TempPathFactory) -> tuple[Scenario, LicSelector]:
    scenario = load_scenario("cylinder-clutter", "{stop: {timeout_s: 0.2}}")
    return learn(planar_library(tmp_path_factory.mktemp("plane") / "library", scenario))


@pytest.fixture(scope="module")
def space(tmp_path_factory: pytest.TempPathFactory) -> tuple[Scenario, LicSelector]:
    return learn(sphere_library(tmp_path_factory.mktemp("space") / "library"))


@pytest.fixture
def said() -> list[str]:
    return []


@pytest.fixture
def explorer(plane: tuple[Scenario, LicSelector], said: list[str]) -> Iterator[Explorer]:
    explorer = Explorer(open_meshcat(in_plane=True), *plane, say=said.append)
    yield explorer


def drawn(meshcat: Meshcat, *paths: str) -> list[bytes]:
    """What was sent to browsers: a mesh, or where an object is."""
    return [meshcat._GetPackedObject(path) + meshcat._GetPackedTransform(path) for path in paths]


def click(meshcat: Meshcat, name: str) -> None:
    """What a browser sends when a button is clicked, in msgpack."""
    fields = (b"type", b"button"), (b"name", name.encode())
    text = b"".join(bytes([0xA0 + len(part)]) + part for field in fields for part in field)
    meshcat._InjectWebsocketMessage(bytes([0x82]) + text)


def test_a_moved_slider_moves_goal_map_and_arm(explorer: Explorer) -> None:
    meshcat, screen = explorer._meshcat, explorer._screen
    assert not explorer.step()
    views = []
    for y in (-0.3, 0.3):
        meshcat.SetSliderValue(GOAL_Y, y)
        began = time.process_time()
        assert explorer.step()
        assert time.process_time() - began < 0.2
        assert not explorer.step()
        assert explorer._situation.p_WG[1] == pytest.approx(y)
        views.append(drawn(meshcat, "/task/goal", "/map"))
    assert all(a != b for a, b in zip(*views, strict=True))
    estimate = explorer._selector.objective(explorer._situation)
    found = map_success(explorer._selector, explorer._situation)
    assert found.best is not None
    best = found.starts.take(np.array([np.nanargmax(found.probability)]))
    context = screen._scene.plant.GetMyContextFromRoot(screen._context)
    q = screen._scene.plant.GetPositions(context, screen._scene.arm)[3:]
    np.testing.assert_array_equal(q, found.best.q)
    shown = meshcat.GetSliderValue(ESTIMATE)
    assert shown == pytest.approx(100 * np.clip(estimate.values(best)[0], 0, 1), abs=0.51)


def test_another_environment_is_drawn_in_place_of_the_first(explorer: Explorer) -> None:
    place = "/drake/visualizer/clutter/object3"
    before, marks = drawn(explorer._meshcat, place), drawn(explorer._meshcat, "/map")
    explorer._meshcat.SetSliderValue(ENVIRONMENT, 1)
    assert explorer.step()
    assert drawn(explorer._meshcat, "/map") != marks
    # The clutter is drawn when the slider rests.
    assert drawn(explorer._meshcat, place) == before
    assert explorer.step()
    assert drawn(explorer._meshcat, place) != before
    assert not explorer.step()


def test_another_category_takes_over_the_page(
    explorer: Explorer, space: tuple[Scenario, LicSelector], monkeypatch: pytest.MonkeyPatch
) -> None:
    meshcat, other = explorer._meshcat, "sphere-aperture-clutter"
    monkeypatch.setattr(explorer, "step", lambda: click(meshcat, other))
    assert explorer.run(["passage-clutter", other]) == other
    Explorer(meshcat, *space, say=lambda line: None)
    assert "blocked" in meshcat.GetSliderNames()
    assert meshcat.GetButtonNames() == [REACH]


def test_after_a_failure_the_second_choice_is_shown_and_reached_from(
    explorer: Explorer, said: list[str]
) -> None:
    meshcat = explorer._meshcat
    assert meshcat.GetButtonNames() == [REACH]
    click(meshcat, REACH)
    assert explorer.step()
    assert "timeout after 0.2 s" in said[-1]
    assert meshcat.GetButtonNames() == [REACH, AGAIN]
    first = explorer._last
    assert first is not None
    before = drawn(meshcat, "/map")
    click(meshcat, AGAIN)
    assert explorer.step()
    assert meshcat.GetButtonNames() == [REACH]
    assert drawn(meshcat, "/map") != before
    chosen = explorer._selector.select(explorer._situation).start
    click(meshcat, REACH)
    assert explorer.step()
    second = explorer._last
    assert second is not None
    assert second[0].after == (first[0].start,)
    np.testing.assert_array_equal(second[0].start.x0, chosen.x0)
    assert len(explorer._situation.failed) == 1
    # Another goal is another trial.
    meshcat.SetSliderValue(GOAL_Y, 0.1)
    assert explorer.step()
    assert meshcat.GetButtonNames() == [REACH] and explorer._situation.failed == ()


def test_what_is_impossible_is_said(
    explorer: Explorer, said: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(request: object, keep_states: bool) -> None:
        raise RequestError("no way")

    monkeypatch.setattr(explore, "simulate_request", refuse)
    click(explorer._meshcat, REACH)
    assert explorer.step()
    assert said[-1] == "lic: no way"


def test_blocked_apertures_leave_the_map(space: tuple[Scenario, LicSelector]) -> None:
    meshcat = open_meshcat(in_plane=False)
    explorer = Explorer(meshcat, *space, say=lambda line: None)
    for blocked in (12, 15):
        meshcat.SetSliderValue("blocked", blocked)
        assert explorer.step()
        found = map_success(explorer._selector, explorer._situation)
        assert len(found.starts) <= 20 - blocked
        mesh = mark_starts(found)
        assert mesh.vertices.shape == (3, 8 * len(found.starts)) == mesh.colors.shape
        assert mesh.faces.shape == (3, 8 * len(found.starts)) and mesh.faces.max() < 8 * 20
        # The marks stand in the board.
        assert np.unique(mesh.vertices[0].round(6)).tolist() == [0.53]


def test_starts_near_failed_ones_are_unknown(plane: tuple[Scenario, LicSelector]) -> None:
    scenario, selector = plane
    starts = make_starts(scenario, scenario.sample_instance("evaluation", 0))
    only_first = LicSelector(selector.first)
    situation = Situation(p_WG=np.array([0.6, 0.1, 0.0]), starts=starts)
    found = map_success(only_first, situation)
    assert found.best is not None and not np.isnan(found.probability).any()
    values = only_first.objective(situation).values(starts.grid)
    assert found.probability.max() >= np.clip(values.max(), 0.0, 1.0) - 1e-12
    failed = (FailedReach.from_start(found.best),)
    after = map_success(only_first, replace(situation, failed=failed))
    near = np.abs(after.starts.x0[:, 1] - found.best.x0[1]) < 0.1 + 1e-9
    np.testing.assert_array_equal(np.isnan(after.probability), near)
    grey = mark_starts(after).colors.T.reshape(-1, 3, 3)[near]
    assert np.ptp(grey) == 0.0
