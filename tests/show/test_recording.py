import re
import struct
from base64 import b64decode
from pathlib import Path

import numpy as np
import pytest
from support.browser import assert_shows_a_scene, hue_share, visit
from support.kinematics import link_origins
from support.reaches import free_space, reach_request
from support.worlds import cylinder, make_clutter

from lic_drake.errors import LicError
from lic_drake.reach.environment import Environment
from lic_drake.reach.scenario import load_scenario
from lic_drake.reach.trace import ReachTrace
from lic_drake.show.recording import MOVE_S, PAUSE_S, Recording, frame_rate
from lic_drake.starts import board_starts

TICKS_PER_SECOND = 250
P_WG = np.array([0.6, 0.1, 0.0])
EASY_START = np.array(reach_request(free_space()).start.x0)
EASY_POSTURE = np.array([-0.6, 1.0, 0.5])
LAST_LINK = b"/drake/visualizer/planar_arm/link3"


def messages_of(html: str) -> list[bytes]:
    """The messages (msgpack) with which the file builds its scene."""
    return [b64decode(text) for text in re.findall(r"base64,([\w+/]+=*)", html)]


def positions_of(html: str, path: bytes) -> dict[int, np.ndarray]:
    """Recorded positions of an object, tick -> (x, y, z), read from the msgpack bytes."""
    (animation,) = [message for message in messages_of(html) if b"set_animation" in message]
    track = animation[animation.index(path) :]
    track = track[: track.index(b".quaternion")]
    # {"time": n, "value": [x, y, z]}: n in 1, 2 or 3 bytes, the others as doubles.
    entry = rb"\x82\xa4time([\x00-\x7f]|\xcc.|\xcd..)\xa5value\x93\xcb(.{8})\xcb(.{8})\xcb(.{8})"
    return {
        int.from_bytes(time[1:] or time): np.array(struct.unpack(">3d", x + y + z))
        for time, x, y, z in re.findall(entry, track, re.DOTALL)
    }


@pytest.fixture(scope="module")
def recorded() -> tuple[list[ReachTrace], str]:
    """Three short reaches from different bases, one after the other, and their recording."""
    scenario = free_space(0.4)
    clutter = make_clutter(cylinder(0.5, 0.35, movable=True), cylinder(0.9, 0.6))
    recording, traces = Recording(scenario, clutter), []
    for base in (np.array([0.0, -0.3, 0.0]), np.zeros(3), np.array([0.05, 0.2, 0.0])):
        environment = Environment(scenario, clutter, b0=base)
        result = environment.reach(P_WG + base, EASY_START + base, keep_states=True)
        assert (result.outcome, result.detail) == ("timeout", "")
        recording.add_reach(result.trace, P_WG + base, f"attempt <{len(traces)}>")
        traces.append(result.trace)
    return traces, recording.html()


def test_the_frames_show_the_arm_where_it_was(recorded: tuple[list[ReachTrace], str]) -> None:
    traces, html = recorded
    frames = positions_of(html, LAST_LINK)
    arm, begin = free_space().arm(), 0
    for trace in traces:
        # 25 samples a second and as many frames, at their tick or, by rounding, the one before.
        for k, q in enumerate(trace.q):
            tick = begin + 10 * k
            assert (tick in frames) != (tick - 1 in frames)
            frame = frames[tick] if tick in frames else frames[tick - 1]
            expected = [*(link_origins(arm, q)[2] + trace.b0[:2]), 0.0]
            np.testing.assert_allclose(frame, expected, atol=1e-9)
        # The next reach begins at a whole second, after a pause.
        begin += TICKS_PER_SECOND * int(np.ceil(trace.time_s[-1] + PAUSE_S))
    assert len(frames) == sum(len(trace.q) for trace in traces)


def test_it_shows_every_object_and_plays_offline(recorded: tuple[list[ReachTrace], str]) -> None:
    _, html = recorded
    objects = [message for message in messages_of(html) if b"set_object" in message]
    paths = {path.decode() for m in objects for path in re.findall(rb"/[a-z][\w/]+", m)}
    assert any(path.startswith("/drake/visualizer/clutter/object0") for path in paths)
    assert any(path.endswith("surroundings/object1_visual") for path in paths)
    assert {"/task/goal", "/floor"} <= paths
    # A second of pause after 0.4 s, and every reach begins at a whole one.
    for words in ("from 0 s: attempt &lt;0&gt;", "from 2 s: attempt &lt;1&gt;"):
        assert html.count(words) == 1
    assert not re.search(r"<(script|link|img|iframe)[^>]*(src|href)\s*=", html)
    assert not re.search(r"@import|\bimport\s*\(?\s*['\"]http", html)


def test_the_robot_moves_base_torso_and_arm_in_that_order_and_the_arm_goes_back() -> None:
    scenario = load_scenario("sphere-aperture-clutter", "{stop: {timeout_s: 0.4}}")
    instance = scenario.sample_instance("training", 0)
    starts = board_starts(scenario, instance, b0=np.array([0.0, 0.05, 0.2]))
    b0, q, x0 = starts.grid.b0[7], starts.grid.q[7], starts.grid.x0[7]
    p_WG = scenario.goals("training", 0)[4]
    environment = Environment(scenario, instance, b0=np.array([0.0, 0.05, 0.2]))
    result = environment.reach(p_WG, x0, keep_states=True)
    assert result.outcome == "timeout"

    recording = Recording(scenario, instance, approach=True)
    recording.move_to(b0, q)
    recording.add_reach(result.trace, p_WG)
    recording.retract(result.trace)
    html = recording.html()
    base, torso, wrist = (
        positions_of(html, b"/drake/visualizer/pr2/" + link)
        for link in (b"base_link", b"torso_lift_link", b"r_wrist_roll_link")
    )
    end = round(MOVE_S * TICKS_PER_SECOND)
    p_WB = np.array(list(base.values()))[:, :2]
    np.testing.assert_allclose(p_WB[0], p_WB[-1] - [0.0, 0.05], atol=1e-3)
    # Base: the first second. Torso: the second one. Then the arm, which ends where it began.
    assert max(tick for tick in base if base[tick][1] < base[max(base)][1] - 1e-9) <= end
    rising = [tick for tick in torso if torso[tick][2] < torso[max(torso)][2] - 1e-9]
    assert end < max(rising) <= 2 * end
    offset = {tick: wrist[tick] - torso[tick] for tick in wrist}
    moving = [t for t in offset if np.linalg.norm(offset[t] - offset[min(offset)]) > 1e-6]
    assert min(moving) >= 2 * end
    np.testing.assert_allclose(offset[max(offset)], offset[min(offset)], atol=1e-6)
    content = b"".join(messages_of(html))
    for name in (b"object39", b"/task/goal"):
        assert name in content


@pytest.mark.parametrize(("control", "frames"), [(25, 25), (100, 25), (30, 30), (31, 15.5), (1, 1)])
def test_frames_are_drawn_at_control_instants(control: float, frames: float) -> None:
    assert frame_rate(control) == frames


def test_an_invalid_start_is_recorded_as_nothing_and_bad_paths_are_one_error(
    tmp_path: Path,
) -> None:
    scenario = free_space(0.2)
    clutter = make_clutter(cylinder(*EASY_START[:2]))
    recording = Recording(scenario, clutter)
    result = Environment(scenario, clutter).reach(P_WG, EASY_START, keep_states=True)
    assert result.outcome == "invalid_start"
    recording.add_reach(result.trace, P_WG)
    recording.save(tmp_path / "reach.html")
    assert (tmp_path / "reach.html").stat().st_size > 100_000
    for path in (tmp_path / "none" / "reach.html", tmp_path):
        with pytest.raises(LicError) as caught:
            recording.save(path)
        assert str(path) in str(caught.value)
        assert "\n" not in str(caught.value)


@pytest.mark.browser
def test_a_browser_shows_arm_and_clutter(tmp_path: Path, chromium: str) -> None:
    scenario = load_scenario("cylinder-clutter", "{stop: {timeout_s: 0.4}}")
    instance = scenario.sample_instance("evaluation", 0)
    recording = Recording(scenario, instance)
    result = Environment(scenario, instance).reach(P_WG, EASY_START, keep_states=True)
    recording.add_reach(result.trace, P_WG)
    recording.save(tmp_path / "reach.html")
    address, size = f"file://{tmp_path / 'reach.html'}", (600, 400)
    image, console = visit(chromium, address, tmp_path, size)
    assert console == []
    # Without the upper edge, where Meshcat puts its controls.
    assert_shows_a_scene(image[40:])
    assert hue_share(image[40:], 25, 50) > 2e-3, "movable cylinders"
    assert hue_share(image[40:], 0, 20) > 2e-3, "fixed cylinders"
