import base64
import re
import struct
from pathlib import Path

import numpy as np
import pytest
from support.browser import assert_shows_a_scene, hue_share, visit
from support.reaches import free_space, reach_request, small_clutter
from support.worlds import cylinder, make_clutter

from lic_drake.errors import LicError
from lic_drake.reach.environment import Environment
from lic_drake.reach.rollout import run_reach, simulate_request
from lic_drake.reach.scenario import load_scenario
from lic_drake.reach.trace import ReachTrace
from lic_drake.show.recording import PAUSE_S, ReachRecording, frame_rate

TICKS_PER_SECOND = 250
P_WG = np.array([0.6, 0.1, 0.0])
EASY_START = reach_request(free_space()).start.x0
LAST_LINK = b"/drake/visualizer/planar_arm/link3"


def animation_of(html: str) -> bytes:
    """The message (msgpack) with which the file sets its animation."""
    messages = [base64.b64decode(text) for text in re.findall(r"base64,([\w+/]+=*)", html)]
    (animation,) = [message for message in messages if b"set_animation" in message]
    return animation


def positions_of(animation: bytes, path: bytes) -> dict[int, np.ndarray]:
    """Recorded positions of an object, tick -> (x, y, z), read from the msgpack bytes."""
    track = animation[animation.index(path) :]
    track = track[: track.index(b".quaternion")]
    # {"time": n, "value": [x, y, z]}: n in 1, 2 or 3 bytes, the others as doubles.
    entry = rb"\x82\xa4time([\x00-\x7f]|\xcc.|\xcd..)\xa5value\x93\xcb(.{8})\xcb(.{8})\xcb(.{8})"
    return {
        int.from_bytes(time[1:] or time): np.array(struct.unpack(">3d", x + y + z))
        for time, x, y, z in re.findall(entry, track, re.DOTALL)
    }


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> tuple[list[ReachTrace], str]:
    """Two short reaches, one after the other, and the file that shows them."""
    scenario = free_space(1.0)
    clutter = make_clutter(cylinder(0.5, 0.35, movable=True), cylinder(0.9, 0.6))
    recording = ReachRecording(scenario, clutter)
    environment = Environment(scenario, clutter)
    goals = (P_WG, P_WG * [1, -1, 1])
    reaches = [environment.reach(p_WG, EASY_START, keep_states=True) for p_WG in goals]
    for result, p_WG in zip(reaches, goals, strict=True):
        recording.add_reach(result.trace, p_WG)
    path = tmp_path_factory.mktemp("recording") / "reach.html"
    recording.save(path)
    assert all(outcome == "timeout" and not detail for outcome, _, detail in reaches)
    return [trace for _, trace, _ in reaches], path.read_text(encoding="utf-8")


def test_the_frames_show_the_arm_where_it_was(recorded: tuple[list[ReachTrace], str]) -> None:
    traces, html = recorded
    frames = positions_of(animation_of(html), LAST_LINK)
    kinematics = free_space().arm().kinematics
    begin = 0
    for trace in traces:
        # 25 samples a second and as many frames, at their tick or, by rounding, the one before.
        for k, q in enumerate(trace.q):
            tick = begin + 10 * k
            assert (tick in frames) != (tick - 1 in frames)
            frame = frames[tick] if tick in frames else frames[tick - 1]
            np.testing.assert_allclose(frame, [*kinematics.link_origins(q)[2], 0.0], atol=1e-9)
        # The next reach begins at a whole second, after a pause.
        begin += TICKS_PER_SECOND * round(trace.time_s[-1] + PAUSE_S)
    assert len(frames) == 2 * 26


def test_it_shows_every_object(recorded: tuple[list[ReachTrace], str]) -> None:
    _, html = recorded
    messages = [base64.b64decode(text) for text in re.findall(r"base64,([\w+/]+=*)", html)]
    paths = {
        match.decode()
        for message in messages
        for match in re.findall(rb"/[a-z][\w/]+", message)
        if b"set_object" in message
    }
    assert any(path.startswith("/drake/visualizer/clutter/object0") for path in paths)
    assert any(path.endswith("surroundings/object1_visual") for path in paths)
    assert {"/task/goal", "/task/start_line"} <= paths


def test_it_plays_offline(recorded: tuple[list[ReachTrace], str]) -> None:
    _, html = recorded
    assert not re.search(r"<(script|link|img|iframe)[^>]*(src|href)\s*=", html)
    assert not re.search(r"@import|\bimport\s*\(?\s*['\"]http", html)


@pytest.mark.parametrize("environment", [0, 1])
def test_a_recorded_reach_is_the_simulated_one(environment: int) -> None:
    scenario = small_clutter(2.5)
    request = reach_request(scenario, (0.7, 0.0), 0.0, 90.0, environment=environment)
    expected = run_reach(request)
    assert expected.peak_contacts > 0
    for _ in range(2):
        outcome, trace, detail = simulate_request(request, keep_states=True)
        assert (outcome, detail) == (expected.outcome, expected.detail)
        assert trace.time_s[-1] == expected.duration_s
        assert tuple(trace.q[-1]) == expected.q_final
        assert max(trace.peak_force) == expected.peak_force
        # What is drawn: the whole scene at every sample, as the rollout read it.
        assert [tuple(state.q) for state in trace.states] == [tuple(q) for q in trace.q]
        np.testing.assert_array_equal(trace.states[-1].p_WO, trace.p_WO)


def test_a_base_aside_carries_the_arm_in_the_recording(tmp_path: Path) -> None:
    scenario = free_space(0.2)
    clutter = make_clutter(cylinder(0.5, 0.35, movable=True))
    recording, begin = ReachRecording(scenario, clutter), 0
    kinematics, expected = scenario.arm().kinematics, {}
    # The base stands elsewhere in each reach of a recording.
    for base in (np.array([0.0, -0.3, 0.0]), np.zeros(3), np.array([0.05, 0.2, 0.0])):
        environment = Environment(scenario, clutter, p_WR=base)
        trace = environment.reach(P_WG + base, EASY_START + base, keep_states=True).trace
        recording.add_reach(trace, P_WG + base)
        for k, q in enumerate(trace.q):
            expected[begin + 10 * k] = base[:2] + kinematics.link_origins(q)[2]
        begin += TICKS_PER_SECOND * 2
    recording.save(tmp_path / "reach.html")
    html = (tmp_path / "reach.html").read_text(encoding="utf-8")
    frames = positions_of(animation_of(html), LAST_LINK)
    assert len(frames) == len(expected)
    for tick, position in expected.items():
        frame = frames[tick] if tick in frames else frames[tick - 1]
        np.testing.assert_allclose(frame, [*position, 0.0], atol=1e-9)


@pytest.mark.parametrize(("control", "frames"), [(25, 25), (100, 25), (30, 30), (31, 15.5), (1, 1)])
def test_frames_are_drawn_at_control_instants(control: float, frames: float) -> None:
    assert frame_rate(control) == frames


def test_a_start_that_touches_is_told_and_the_recording_goes_on(tmp_path: Path) -> None:
    scenario = free_space(0.2)
    clutter = make_clutter(cylinder(*EASY_START[:2]))
    recording, environment = ReachRecording(scenario, clutter), Environment(scenario, clutter)
    for x0, expected in ((EASY_START, "invalid_start"), (EASY_START + [0, 0.1, 0], "timeout")):
        result = environment.reach(P_WG, x0, keep_states=True)
        assert result.outcome == expected
        recording.add_reach(result.trace, P_WG)
    recording.save(tmp_path / "reach.html")
    assert (tmp_path / "reach.html").stat().st_size > 100_000


def test_what_cannot_be_written_is_one_clear_error(tmp_path: Path) -> None:
    recording = ReachRecording(free_space(0.2), make_clutter())
    for path in (tmp_path / "none" / "reach.html", tmp_path):
        with pytest.raises(LicError) as caught:
            recording.save(path)
        assert str(path) in str(caught.value)
        assert "\n" not in str(caught.value)


@pytest.mark.browser
def test_a_browser_shows_arm_clutter_goal_and_start_line(tmp_path: Path, chromium: str) -> None:
    scenario = load_scenario("cylinder-clutter", "{stop: {timeout_s: 0.4}}")
    instance = scenario.sample_instance("evaluation", 0)
    recording = ReachRecording(scenario, instance)
    result = Environment(scenario, instance).reach(P_WG, EASY_START, keep_states=True)
    recording.add_reach(result.trace, P_WG)
    recording.save(tmp_path / "reach.html")
    image, console = visit(chromium, f"file://{tmp_path / 'reach.html'}", tmp_path)
    assert console == []
    # Without the upper edge, where Meshcat puts its controls.
    assert_shows_a_scene(image[40:])
    assert hue_share(image[40:], 25, 50) > 2e-3, "movable cylinders"
    assert hue_share(image[40:], 0, 20) > 2e-3, "fixed cylinders"
    assert hue_share(image[40:], 110, 150) > 1e-4, "start line"


@pytest.mark.slow
@pytest.mark.browser
def test_an_empty_scene_and_a_console_error_are_noticed(tmp_path: Path, chromium: str) -> None:
    page = tmp_path / "page.html"
    page.write_text("<body><script>console.log('one'); none()</script></body>", encoding="utf-8")
    image, console = visit(chromium, f"file://{page}", tmp_path)
    assert len(console) == 2
    assert "none is not defined" in console[1]
    with pytest.raises(AssertionError):
        assert_shows_a_scene(image)
