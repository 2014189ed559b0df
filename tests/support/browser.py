"""What a page looks like in a headless Chromium, and what it writes to the console."""

import re
import subprocess
from pathlib import Path

import numpy as np
from matplotlib.colors import rgb_to_hsv
from matplotlib.image import imread


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


def hue_share(image: np.ndarray, low: float, high: float) -> float:
    """Returns the share of a picture's colourful points with a hue in a range, degrees."""
    hue, saturation, _ = np.moveaxis(rgb_to_hsv(image), -1, 0)
    return float(np.mean((360.0 * hue > low) & (360.0 * hue < high) & (saturation > 0.3)))


def assert_shows_a_scene(image: np.ndarray, least_goal: float = 5e-5) -> None:
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
