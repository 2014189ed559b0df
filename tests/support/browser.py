"""What a page looks like in a headless Chromium, and what it writes to the console."""

import asyncio
import base64
import io
import json
import os
import re
import signal
import subprocess
import time
import urllib.request
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.colors import rgb_to_hsv
from matplotlib.image import imread

LEAST_GOAL = 5e-5
"""Share of a picture's points that a goal has at the least."""


def visit(
    chromium: str, address: str, tmp_path: Path, size: tuple[int, int] = (1200, 800)
) -> tuple[np.ndarray, list[str]]:
    """Opens a page without any network.

    Returns:
        The picture, shape (height, width, 3), from 0 to 1, and the lines on the console.
    """
    picture = tmp_path / "page.png"
    command = [
        *(chromium, "--headless", "--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader"),
        *("--enable-unsafe-swiftshader", "--virtual-time-budget=6000", "--enable-logging=stderr"),
        # Whatever is not in the page itself cannot be found.
        "--host-resolver-rules=MAP * ~NOTFOUND",
        f"--window-size={size[0]},{size[1]}",
        *(f"--user-data-dir={tmp_path / 'profile'}", f"--screenshot={picture}", address),
    ]
    result = subprocess.run(command, check=True, capture_output=True, text=True, timeout=120)
    console = re.findall(r':CONSOLE[:(]\d+[^"]*(".*)', result.stderr)
    return imread(picture)[:, :, :3], console


def _left(image: np.ndarray) -> np.ndarray:
    """Returns the part of a picture that the controls do not cover."""
    return image[:, : image.shape[1] * 7 // 10]


_OPEN = """for (const button of document.querySelectorAll(".close-button"))
  if (button.textContent === "Open Controls") button.click();"""
_MOVE = """(([name, value]) => {
  for (const row of document.querySelectorAll("li.cr"))
    if (row.querySelector(".property-name")?.textContent === name) {
      const input = row.querySelector("input");
      input.value = value;
      input.dispatchEvent(new Event("change"));
      input.dispatchEvent(new Event("blur"));
      return true;
    }
  return false;
})"""


def move_slider(
    chromium: str, address: str, tmp_path: Path, name: str, value: float, patience_s: float = 120.0
) -> tuple[np.ndarray, np.ndarray]:
    """Opens a live Meshcat and moves a slider in its controls, by the DevTools protocol.

    Returns:
        The pictures before and after it, shape (height, width, 3): the first that shows clutter
        and goal, and the first that differs from it, or the last ones if `patience_s` seconds pass.
    """
    from tornado.websocket import websocket_connect

    async def drive(url: str) -> tuple[np.ndarray, np.ndarray]:
        socket = await websocket_connect(url, max_message_size=2**26)

        async def call(method: str, **params: Any) -> Any:
            await socket.write_message(json.dumps({"id": 1, "method": method, "params": params}))
            while True:
                answer = json.loads(await socket.read_message() or "{}")
                if answer.get("id") == 1:
                    return answer["result"]

        async def look(is_awaited: Callable[[np.ndarray], bool]) -> np.ndarray:
            ends = time.monotonic() + patience_s
            while True:
                await asyncio.sleep(1.0)
                await call("Runtime.evaluate", expression=_OPEN)
                data = (await call("Page.captureScreenshot"))["data"]
                image: np.ndarray = imread(io.BytesIO(base64.b64decode(data)))[:, :, :3]
                if is_awaited(image) or time.monotonic() > ends:
                    return image

        def is_complete(image: np.ndarray) -> bool:
            """Returns whether clutter and goal are there: objects arrive one after the other."""
            return hue_share(image, 0, 50) > 2e-3 and hue_share(image, 175, 200) > LEAST_GOAL

        def has_changed(image: np.ndarray) -> bool:
            return is_complete(image) and bool(np.any(_left(image) != _left(before)))

        before = await look(is_complete)
        script = f"{_MOVE}({json.dumps([name, str(value)])})"
        moved = await call("Runtime.evaluate", expression=script)
        assert moved["result"]["value"], f"no slider {name!r}"
        return before, await look(has_changed)

    profile = tmp_path / "profile"
    command = [
        *(chromium, "--headless", "--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader"),
        *("--enable-unsafe-swiftshader", "--remote-debugging-port=0", "--window-size=1000,700"),
        *(f"--user-data-dir={profile}", address),
    ]
    browser = subprocess.Popen(command, stderr=subprocess.DEVNULL, start_new_session=True)
    try:
        ready, ends = profile / "DevToolsActivePort", time.monotonic() + 60.0
        while not (ready.exists() and ready.read_text()):
            assert time.monotonic() < ends, "the browser did not start"
            time.sleep(0.1)
        port = ready.read_text().split()[0]
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/json") as answer:
            pages = json.load(answer)
        (page,) = (page for page in pages if page["type"] == "page")
        return asyncio.run(drive(page["webSocketDebuggerUrl"]))
    finally:
        os.killpg(browser.pid, signal.SIGKILL)
        browser.wait()


def hue_share(image: np.ndarray, low: float, high: float) -> float:
    """Returns the share of a picture's colourful points with a hue in a range, degrees."""
    hue, saturation, _ = np.moveaxis(rgb_to_hsv(image), -1, 0)
    return float(np.mean((360.0 * hue > low) & (360.0 * hue < high) & (saturation > 0.3)))


def assert_shows_a_scene(image: np.ndarray, least_goal: float = LEAST_GOAL) -> None:
    """Sees that a picture shows clutter and an arm, not an empty scene.

    Args:
        image: The picture.
        least_goal: Share of its points that the goal has at the least.
    """
    _, saturation, value = np.moveaxis(rgb_to_hsv(image), -1, 0)
    assert len(np.unique(image.reshape(-1, 3), axis=0)) > 500
    # Hues in degrees: movable 35, fixed 8, goal 188; the arm is grey, darker than the background.
    assert hue_share(image, 0, 50) > 2e-3, "clutter"
    assert hue_share(image, 175, 200) > least_goal, "goal"
    assert np.mean((saturation < 0.12) & (value > 0.3) & (value < 0.93)) > 2e-3, "arm"
